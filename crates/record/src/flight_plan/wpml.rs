//! DJI's WPML, version 1.0.2: the template that Pilot 2 shows and edits, and the wayline that the aircraft flies (DJI Cloud
//! API, *WPML*). Heights count from the place of take-off.

use super::{FlightPlan, Heights, STOP_S};
use std::fmt::Write as _;

/// The aircraft in DJI's list: Mavic 3 Enterprise with its wide camera. Pilot 2 lets the user choose another.
const DRONE: (u8, u8) = (77, 0);
const PAYLOAD: (u8, u8) = (66, 0);
/// Shortest distance from a place at which a turn that is not stopped in begins, m.
const TURN_M: f64 = 2.0;
/// Highest speed on the way to the first place, m/s (*waylines.wpml*, globalTransitionalSpeed).
const TRANSITION_MAX_M_S: f64 = 15.0;
/// Range of the height to which the aircraft climbs first, m (*waylines.wpml*, takeOffSecurityHeight).
const TAKE_OFF_M: (f64, f64) = (2.0, 1500.0);

/// `template.kml` and `waylines.wpml`.
pub(super) fn encode(plan: &FlightPlan, made_ms: u64) -> [String; 2] {
    let speed = plan.speed_m_s;
    let height = |alt_amsl_m| plan.height_m(alt_amsl_m, Heights::TakeOff);
    let highest = plan.points.iter().map(|p| height(p.alt_amsl_m));
    let highest = highest.fold(plan.take_off_height_m, f64::max);
    let config = mission_config(plan, highest);
    let mut template = String::new();
    let mut wayline = String::new();
    for (index, p) in plan.points.iter().enumerate() {
        let above = height(p.alt_amsl_m);
        let place = format!(
            "<Point><coordinates>{:.8},{:.8}</coordinates></Point>\n<wpml:index>{index}</wpml:index>\n",
            p.lon_deg, p.lat_deg
        );
        // The aircraft coordinates turns itself between two places that it does not stop at.
        let (mode, damping_m) = if p.stops || index == 0 || index + 1 == plan.points.len() {
            ("toPointAndStopWithDiscontinuityCurvature", 0.0)
        } else {
            ("coordinateTurn", TURN_M)
        };
        let turn = format!(
            "<wpml:waypointTurnParam><wpml:waypointTurnMode>{mode}</wpml:waypointTurnMode>\
             <wpml:waypointTurnDampingDist>{damping_m}</wpml:waypointTurnDampingDist></wpml:waypointTurnParam>\n"
        );
        let wait = if p.stops { wait(index) } else { String::new() };
        let _ = write!(
            template,
            "<Placemark>\n{place}<wpml:ellipsoidHeight>{above:.1}</wpml:ellipsoidHeight>\n\
             <wpml:height>{above:.1}</wpml:height>\n<wpml:useGlobalHeight>0</wpml:useGlobalHeight>\n\
             <wpml:useGlobalSpeed>1</wpml:useGlobalSpeed>\n<wpml:useGlobalHeadingParam>1</wpml:useGlobalHeadingParam>\n\
             <wpml:useGlobalTurnParam>0</wpml:useGlobalTurnParam>\n{turn}<wpml:useStraightLine>1</wpml:useStraightLine>\n\
             {wait}</Placemark>\n"
        );
        let _ = write!(
            wayline,
            "<Placemark>\n{place}<wpml:executeHeight>{above:.1}</wpml:executeHeight>\n\
             <wpml:waypointSpeed>{speed:.1}</wpml:waypointSpeed>\n{HEADING}{turn}\
             <wpml:useStraightLine>1</wpml:useStraightLine>\n{wait}</Placemark>\n"
        );
    }
    let template = document(&format!(
        "<wpml:author>Plumage</wpml:author>\n<wpml:createTime>{made_ms}</wpml:createTime>\n\
         <wpml:updateTime>{made_ms}</wpml:updateTime>\n{config}<Folder>\n\
         <wpml:templateType>waypoint</wpml:templateType>\n<wpml:templateId>0</wpml:templateId>\n\
         <wpml:waylineCoordinateSysParam><wpml:coordinateMode>WGS84</wpml:coordinateMode>\
         <wpml:heightMode>relativeToStartPoint</wpml:heightMode></wpml:waylineCoordinateSysParam>\n\
         <wpml:autoFlightSpeed>{speed:.1}</wpml:autoFlightSpeed>\n<wpml:globalHeight>{highest:.1}</wpml:globalHeight>\n\
         <wpml:gimbalPitchMode>manual</wpml:gimbalPitchMode>\n\
         <wpml:globalWaypointHeadingParam><wpml:waypointHeadingMode>followWayline</wpml:waypointHeadingMode>\
         <wpml:waypointHeadingPathMode>followBadArc</wpml:waypointHeadingPathMode></wpml:globalWaypointHeadingParam>\n\
         <wpml:globalWaypointTurnMode>toPointAndStopWithDiscontinuityCurvature</wpml:globalWaypointTurnMode>\n\
         <wpml:globalUseStraightLine>1</wpml:globalUseStraightLine>\n{template}</Folder>\n"
    ));
    let length_m = plan.length_m();
    let wayline = document(&format!(
        "{config}<Folder>\n<wpml:templateId>0</wpml:templateId>\n\
         <wpml:executeHeightMode>relativeToStartPoint</wpml:executeHeightMode>\n<wpml:waylineId>0</wpml:waylineId>\n\
         <wpml:distance>{length_m:.1}</wpml:distance>\n<wpml:duration>{:.1}</wpml:duration>\n\
         <wpml:autoFlightSpeed>{speed:.1}</wpml:autoFlightSpeed>\n{wayline}</Folder>\n",
        plan.least_s()
    ));
    [template, wayline]
}

/// The nose follows the way.
const HEADING: &str = "<wpml:waypointHeadingParam><wpml:waypointHeadingMode>followWayline</wpml:waypointHeadingMode>\
    <wpml:waypointHeadingPathMode>followBadArc</wpml:waypointHeadingPathMode></wpml:waypointHeadingParam>\n";

/// The action group by which the aircraft waits at the place with this index.
fn wait(index: usize) -> String {
    format!(
        "<wpml:actionGroup><wpml:actionGroupId>{index}</wpml:actionGroupId>\
         <wpml:actionGroupStartIndex>{index}</wpml:actionGroupStartIndex>\
         <wpml:actionGroupEndIndex>{index}</wpml:actionGroupEndIndex>\
         <wpml:actionGroupMode>sequence</wpml:actionGroupMode>\
         <wpml:actionTrigger><wpml:actionTriggerType>reachPoint</wpml:actionTriggerType></wpml:actionTrigger>\
         <wpml:action><wpml:actionId>0</wpml:actionId><wpml:actionActuatorFunc>hover</wpml:actionActuatorFunc>\
         <wpml:actionActuatorFuncParam><wpml:hoverTime>{STOP_S}</wpml:hoverTime></wpml:actionActuatorFuncParam>\
         </wpml:action></wpml:actionGroup>\n"
    )
}

/// The settings of the mission: take-off, the way to the first place, and the return home at the plan's greatest height, at
/// the end or when the remote control is lost. Omits the place of take-off, which needs a height above the ellipsoid.
fn mission_config(plan: &FlightPlan, highest_m: f64) -> String {
    let (low_m, high_m) = TAKE_OFF_M;
    let up = plan.take_off_height_m.clamp(low_m, high_m);
    format!(
        "<wpml:missionConfig>\n<wpml:flyToWaylineMode>safely</wpml:flyToWaylineMode>\n\
         <wpml:finishAction>goHome</wpml:finishAction>\n<wpml:exitOnRCLost>executeLostAction</wpml:exitOnRCLost>\n\
         <wpml:executeRCLostAction>goBack</wpml:executeRCLostAction>\n\
         <wpml:takeOffSecurityHeight>{up:.1}</wpml:takeOffSecurityHeight>\n\
         <wpml:globalTransitionalSpeed>{:.1}</wpml:globalTransitionalSpeed>\n\
         <wpml:globalRTHHeight>{highest_m:.1}</wpml:globalRTHHeight>\n\
         <wpml:droneInfo><wpml:droneEnumValue>{}</wpml:droneEnumValue>\
         <wpml:droneSubEnumValue>{}</wpml:droneSubEnumValue></wpml:droneInfo>\n\
         <wpml:payloadInfo><wpml:payloadEnumValue>{}</wpml:payloadEnumValue>\
         <wpml:payloadPositionIndex>{}</wpml:payloadPositionIndex></wpml:payloadInfo>\n</wpml:missionConfig>\n",
        plan.speed_m_s.min(TRANSITION_MAX_M_S),
        DRONE.0,
        DRONE.1,
        PAYLOAD.0,
        PAYLOAD.1
    )
}

fn document(inside: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<kml xmlns=\"http://www.opengis.net/kml/2.2\" \
         xmlns:wpml=\"http://www.dji.com/wpmz/1.0.2\">\n<Document>\n{inside}</Document>\n</kml>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::super::tests::plan;
    use super::*;

    /// Each parent element of a waypoint route, with the children that DJI's Cloud API requires in the template and in the
    /// waylines (*Template.kml*, *Waylines.wpml* and *Common Elements* in docs/en/60.api-reference/00.dji-wpml of
    /// dji-sdk/Cloud-API-Doc).
    const CONFIG: [&str; 8] = [
        "flyToWaylineMode",
        "finishAction",
        "exitOnRCLost",
        "executeRCLostAction",
        "takeOffSecurityHeight",
        "globalTransitionalSpeed",
        "droneInfo",
        "payloadInfo",
    ];
    const REQUIRED: [(&str, &[&str], &[&str]); 9] = [
        ("missionConfig", &CONFIG, &CONFIG),
        ("missionConfig", &[], &["globalRTHHeight"]),
        (
            "droneInfo",
            &["droneEnumValue", "droneSubEnumValue"],
            &["droneEnumValue", "droneSubEnumValue"],
        ),
        (
            "payloadInfo",
            &["payloadEnumValue", "payloadPositionIndex"],
            &["payloadEnumValue", "payloadPositionIndex"],
        ),
        (
            "Folder",
            &[
                "templateType",
                "templateId",
                "autoFlightSpeed",
                "waylineCoordinateSysParam",
                "globalWaypointTurnMode",
                "gimbalPitchMode",
                "globalHeight",
                "globalWaypointHeadingParam",
            ],
            &[
                "templateId",
                "waylineId",
                "autoFlightSpeed",
                "executeHeightMode",
            ],
        ),
        (
            "Placemark",
            &[
                "Point",
                "index",
                "useGlobalHeight",
                "ellipsoidHeight",
                "height",
                "useGlobalSpeed",
                "useGlobalHeadingParam",
                "useGlobalTurnParam",
                "waypointTurnParam",
            ],
            &[
                "Point",
                "index",
                "executeHeight",
                "waypointSpeed",
                "waypointHeadingParam",
                "waypointTurnParam",
            ],
        ),
        (
            "waypointTurnParam",
            &["waypointTurnMode", "waypointTurnDampingDist"],
            &["waypointTurnMode", "waypointTurnDampingDist"],
        ),
        ("actionGroup", &ACTION_GROUP, &ACTION_GROUP),
        ("actionActuatorFuncParam", &["hoverTime"], &["hoverTime"]),
    ];
    const ACTION_GROUP: [&str; 6] = [
        "actionGroupId",
        "actionGroupStartIndex",
        "actionGroupEndIndex",
        "actionGroupMode",
        "actionTrigger",
        "action",
    ];
    /// Values of the enumerations, by the same tables.
    const VALUES: [(&str, &[&str]); 13] = [
        ("flyToWaylineMode", &["safely", "pointToPoint"]),
        (
            "finishAction",
            &["goHome", "noAction", "autoLand", "gotoFirstWaypoint"],
        ),
        ("exitOnRCLost", &["goContinue", "executeLostAction"]),
        ("executeRCLostAction", &["goBack", "landing", "hover"]),
        (
            "templateType",
            &["waypoint", "mapping2d", "mapping3d", "mappingStrip"],
        ),
        ("coordinateMode", &["WGS84"]),
        (
            "heightMode",
            &["EGM96", "relativeToStartPoint", "aboveGroundLevel"],
        ),
        (
            "executeHeightMode",
            &["WGS84", "relativeToStartPoint", "realTimeFollowSurface"],
        ),
        ("gimbalPitchMode", &["manual", "usePointSetting"]),
        (
            "waypointHeadingMode",
            &[
                "followWayline",
                "manually",
                "fixed",
                "smoothTransition",
                "towardPOI",
            ],
        ),
        (
            "waypointHeadingPathMode",
            &["clockwise", "counterClockwise", "followBadArc"],
        ),
        ("waypointTurnMode", &TURN_MODES),
        ("globalWaypointTurnMode", &TURN_MODES),
    ];
    const TURN_MODES: [&str; 4] = [
        "coordinateTurn",
        "toPointAndStopWithDiscontinuityCurvature",
        "toPointAndStopWithContinuityCurvature",
        "toPointAndPassWithContinuityCurvature",
    ];

    /// An element: its local name, its children and its text.
    #[derive(Debug, Default)]
    struct Element {
        name: String,
        children: Vec<Element>,
        text: String,
    }

    impl Element {
        fn parse(text: &str) -> Self {
            use quick_xml::events::Event;
            let mut reader = quick_xml::Reader::from_str(text);
            let mut open = vec![Self::default()];
            loop {
                match reader.read_event().unwrap() {
                    Event::Start(tag) => {
                        let name = String::from_utf8(tag.local_name().as_ref().to_vec()).unwrap();
                        open.push(Self {
                            name,
                            ..Self::default()
                        });
                    }
                    Event::Text(inside) => {
                        open.last_mut().unwrap().text +=
                            std::str::from_utf8(&inside).unwrap().trim();
                    }
                    Event::End(_) => {
                        let done = open.pop().unwrap();
                        open.last_mut().unwrap().children.push(done);
                    }
                    Event::Eof => return open.pop().unwrap(),
                    _ => {}
                }
            }
        }

        fn all<'a>(&'a self, name: &str, found: &mut Vec<&'a Self>) {
            if self.name == name {
                found.push(self);
            }
            for child in &self.children {
                child.all(name, found);
            }
        }

        fn find(&self, name: &str) -> Vec<&Self> {
            let mut found = Vec::new();
            self.all(name, &mut found);
            found
        }
    }

    #[test]
    fn both_documents_hold_the_required_elements_and_values() {
        let texts = encode(&plan(), 1_700_000_000_000);
        for (which, text) in texts.iter().enumerate() {
            let document = Element::parse(text);
            for (parent, of_template, of_waylines) in REQUIRED {
                let parents = document.find(parent);
                assert!(!parents.is_empty(), "{parent}");
                for child in [of_template, of_waylines][which] {
                    let has = |p: &&Element| p.children.iter().any(|c| c.name == *child);
                    assert!(parents.iter().all(has), "{parent} without {child}");
                }
            }
            for (name, values) in VALUES {
                for element in document.find(name) {
                    assert!(
                        values.contains(&element.text.as_str()),
                        "{name}: {}",
                        element.text
                    );
                }
            }
            let index: Vec<&str> = document
                .find("index")
                .iter()
                .map(|e| e.text.as_str())
                .collect();
            assert_eq!(index, ["0", "1", "2"]);
            // Longitude before latitude, and no height.
            assert_eq!(
                document.find("coordinates")[1].text,
                "-7.86000000,43.44010000"
            );
            // Only places at which the aircraft stops have a wait.
            let waits = |e: &Element| e.find("hoverTime").len();
            let waits: Vec<usize> = document.find("Placemark").into_iter().map(waits).collect();
            assert_eq!(waits, [1, 0, 1]);
            // A plan does not know its height above the ellipsoid.
            assert!(document.find("takeOffRefPoint").is_empty());
        }
        let waylines = Element::parse(&texts[1]);
        let number = |name: &str, at: usize| waylines.find(name)[at].text.parse::<f64>().unwrap();
        assert_eq!(number("executeHeight", 1), 40.0);
        // It returns at the height of its highest place: 390 m above the sea, 340 m at home.
        assert_eq!(number("globalRTHHeight", 0), 50.0);
        assert_eq!(waylines.find("waypointTurnMode")[1].text, "coordinateTurn");
    }

    #[test]
    fn speeds_and_heights_are_within_their_ranges() {
        let fast = FlightPlan {
            speed_m_s: 18.0,
            take_off_height_m: 1.0,
            ..plan()
        };
        let [_, waylines] = encode(&fast, 0);
        let waylines = Element::parse(&waylines);
        assert_eq!(waylines.find("globalTransitionalSpeed")[0].text, "15.0");
        assert_eq!(waylines.find("takeOffSecurityHeight")[0].text, "2.0");
        assert_eq!(waylines.find("waypointSpeed")[0].text, "18.0");
    }
}
