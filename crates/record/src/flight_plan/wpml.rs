//! DJI's WPML, version 1.0.2: the template that Pilot 2 shows and edits, and the wayline that the aircraft flies (DJI Cloud
//! API, *WPML*). Heights count from the place of take-off.

use super::{FlightPlan, Heights};
use std::fmt::Write as _;

/// The aircraft in DJI's list: Mavic 3 Enterprise with its wide camera. Pilot 2 lets the user choose another.
const DRONE: (u8, u8) = (77, 0);
const PAYLOAD: (u8, u8) = (66, 0);
/// Shortest distance from a place at which a turn that is not stopped in begins, m.
const TURN_M: f64 = 2.0;

/// `template.kml` and `waylines.wpml`.
pub(super) fn encode(plan: &FlightPlan, made_ms: u64) -> [String; 2] {
    let config = mission_config(plan);
    let speed = plan.speed_m_s;
    let height = |alt_amsl_m| plan.height_m(alt_amsl_m, Heights::TakeOff);
    let highest = plan.points.iter().map(|p| height(p.alt_amsl_m));
    let highest = highest.fold(plan.take_off_height_m, f64::max);
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
        let _ = write!(
            template,
            "<Placemark>\n{place}<wpml:ellipsoidHeight>{above:.1}</wpml:ellipsoidHeight>\n\
             <wpml:height>{above:.1}</wpml:height>\n<wpml:useGlobalHeight>0</wpml:useGlobalHeight>\n\
             <wpml:useGlobalSpeed>1</wpml:useGlobalSpeed>\n<wpml:useGlobalHeadingParam>1</wpml:useGlobalHeadingParam>\n\
             <wpml:useGlobalTurnParam>0</wpml:useGlobalTurnParam>\n{turn}<wpml:useStraightLine>1</wpml:useStraightLine>\n\
             <wpml:gimbalPitchAngle>0</wpml:gimbalPitchAngle>\n</Placemark>\n"
        );
        let _ = write!(
            wayline,
            "<Placemark>\n{place}<wpml:executeHeight>{above:.1}</wpml:executeHeight>\n\
             <wpml:waypointSpeed>{speed:.1}</wpml:waypointSpeed>\n{HEADING}{turn}\
             <wpml:useStraightLine>1</wpml:useStraightLine>\n</Placemark>\n"
        );
    }
    let template = document(&format!(
        "<wpml:author>Plumage</wpml:author>\n<wpml:createTime>{made_ms}</wpml:createTime>\n\
         <wpml:updateTime>{made_ms}</wpml:updateTime>\n{config}<Folder>\n\
         <wpml:templateType>waypoint</wpml:templateType>\n<wpml:templateId>0</wpml:templateId>\n\
         <wpml:waylineCoordinateSysParam><wpml:coordinateMode>WGS84</wpml:coordinateMode>\
         <wpml:heightMode>relativeToStartPoint</wpml:heightMode></wpml:waylineCoordinateSysParam>\n\
         <wpml:autoFlightSpeed>{speed:.1}</wpml:autoFlightSpeed>\n<wpml:globalHeight>{highest:.1}</wpml:globalHeight>\n\
         <wpml:caliFlightEnable>0</wpml:caliFlightEnable>\n<wpml:gimbalPitchMode>manual</wpml:gimbalPitchMode>\n\
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
        length_m / speed
    ));
    [template, wayline]
}

/// The nose follows the way.
const HEADING: &str = "<wpml:waypointHeadingParam><wpml:waypointHeadingMode>followWayline</wpml:waypointHeadingMode>\
    <wpml:waypointHeadingPathMode>followBadArc</wpml:waypointHeadingPathMode></wpml:waypointHeadingParam>\n";

/// What is to be done before, after, and when the remote control is lost: it comes home.
fn mission_config(plan: &FlightPlan) -> String {
    let (lat, lon, ground) = plan.home;
    let up = plan.take_off_height_m;
    format!(
        "<wpml:missionConfig>\n<wpml:flyToWaylineMode>safely</wpml:flyToWaylineMode>\n\
         <wpml:finishAction>goHome</wpml:finishAction>\n<wpml:exitOnRCLost>executeLostAction</wpml:exitOnRCLost>\n\
         <wpml:executeRCLostAction>goBack</wpml:executeRCLostAction>\n\
         <wpml:takeOffSecurityHeight>{up:.1}</wpml:takeOffSecurityHeight>\n\
         <wpml:takeOffRefPoint>{lat:.8},{lon:.8},{ground:.1}</wpml:takeOffRefPoint>\n\
         <wpml:globalTransitionalSpeed>{:.1}</wpml:globalTransitionalSpeed>\n\
         <wpml:droneInfo><wpml:droneEnumValue>{}</wpml:droneEnumValue>\
         <wpml:droneSubEnumValue>{}</wpml:droneSubEnumValue></wpml:droneInfo>\n\
         <wpml:payloadInfo><wpml:payloadEnumValue>{}</wpml:payloadEnumValue>\
         <wpml:payloadPositionIndex>{}</wpml:payloadPositionIndex></wpml:payloadInfo>\n</wpml:missionConfig>\n",
        plan.speed_m_s, DRONE.0, DRONE.1, PAYLOAD.0, PAYLOAD.1
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

    /// Every element that DJI's documentation requires is there, and the XML is well formed.
    #[test]
    fn both_documents_hold_the_required_elements() {
        let [template, waylines] = encode(&plan(), 1_700_000_000_000);
        let common = [
            "flyToWaylineMode",
            "finishAction",
            "exitOnRCLost",
            "executeRCLostAction",
            "takeOffSecurityHeight",
            "globalTransitionalSpeed",
            "droneEnumValue",
            "templateId",
            "autoFlightSpeed",
            "index",
            "waypointTurnMode",
        ];
        let own = [
            vec![
                "templateType",
                "coordinateMode",
                "heightMode",
                "globalHeight",
                "height",
                "useGlobalHeight",
            ],
            vec![
                "executeHeightMode",
                "waylineId",
                "executeHeight",
                "waypointSpeed",
                "waypointHeadingMode",
            ],
        ];
        for (text, own) in [&template, &waylines].into_iter().zip(own) {
            for element in common.iter().chain(&own) {
                assert!(text.contains(&format!("<wpml:{element}>")), "{element}");
            }
            assert_eq!(text.matches("<Placemark>").count(), 3);
            let mut reader = quick_xml::Reader::from_str(text);
            loop {
                match reader.read_event() {
                    Ok(quick_xml::events::Event::Eof) => break,
                    Ok(_) => {}
                    Err(e) => panic!("{e}"),
                }
            }
        }
        assert!(waylines.contains("<wpml:executeHeight>40.0</wpml:executeHeight>"));
        assert!(
            waylines.contains("coordinateTurn") && template.contains("-7.86000000,43.44010000")
        );
    }
}
