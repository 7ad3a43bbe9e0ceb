//! Checklist before the first command: each point with the value found and the value expected.

use super::batteries::Batteries;
use super::config::BridgeConfig;
use super::fence::FenceOnBoard;
use crate::dialect::{
    EkfStatusFlags, GPS_RAW_INT_DATA, GpsFixType, HOME_POSITION_DATA, MavSysStatusSensor,
    SYS_STATUS_DATA,
};
use crate::event::event;
use crate::profile::{Meaning, Parameters, Profile, Rule};
use crate::telemetry::distance_m;
use air::geo::Geodetic;
use protocol::SimTime;
use protocol::message::{EventMessage, Severity};
use std::collections::BTreeMap;

/// Time to wait for the vehicle's answers before the list is made without them, s: a choice, because a
/// list that is late is worth more than one that asks in vain.
const WAIT_S: f64 = 4.0;
/// Fewest satellites that a fix should have.
const SATELLITES: u8 = 6;
/// Charge with which a flight may begin, per cent, and with which it should.
const BATTERY_PCT: (u8, u8) = (20, 50);
/// Tolerated distance of the vehicle's home from the scenario's, and the one that breaks its fence (`va`), m.
const HOME_M: (f64, f64) = (50.0, 500.0);
/// Heights of SRTM are right to this in nine of ten cases, m (Farr et al. 2007, the mission's goal).
const GROUND_M: f64 = 16.0;
/// Height over the highest stack at which a vehicle should come home, m: a choice, twice the error of the
/// ground.
const OVER_STACK_M: f64 = 30.0;

/// Words of ArduPlane's check before arming after a landing by its sequence, in small letters, and the cure.
const IN_LANDING: &str = "in landing sequence";
/// What ends it.
const END_LANDING: &str = "; to end it, send DO_SET_MISSION_CURRENT 0 (MAVProxy: wp set 0)";
/// Beginnings of the texts of checks before arming.
const ARMING_TEXTS: [&str; 2] = ["PreArm: ", "Arm: "];

/// Expectations of the mission.
#[derive(Debug, Clone, PartialEq)]
pub struct Expectation {
    /// Its take-off and landing point.
    pub home: Geodetic,
    /// The ground there, m above mean sea level.
    pub home_amsl_m: f64,
    /// True airspeed at which it is to fly, m/s.
    pub airspeed_m_s: f64,
    /// Speed over ground that it is to have at least against the wind, m/s.
    pub least_over_ground_m_s: f64,
    /// The strongest wind where it flies, m/s.
    pub wind_m_s: f64,
    /// Top of the highest stack, m above mean sea level.
    pub stack_top_amsl_m: f64,
    /// Corners of the mission's fence; where empty the one on board is not read.
    pub fence: Vec<Geodetic>,
}

/// Result of one point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Verdict {
    Right,
    /// Needs a person's attention.
    Doubtful,
    /// Prevents take-off.
    Refused,
}

/// One point.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Point {
    pub about: &'static str,
    pub verdict: Verdict,
    pub words: String,
}

/// Telemetry for the checklist.
#[derive(Debug, Clone, Default)]
pub(super) struct Told {
    pub gps: Option<GPS_RAW_INT_DATA>,
    pub ekf: Option<EkfStatusFlags>,
    pub status: Option<SYS_STATUS_DATA>,
    pub batteries: Batteries,
    pub home: Option<HOME_POSITION_DATA>,
    pub fence: Option<FenceOnBoard>,
    pub custom_mode: u32,
    /// The last check before arming that failed, in the vehicle's words.
    pub not_armed: Option<String>,
    /// Equivalent over true airspeed where it is.
    pub eas_over_tas: f64,
}

impl Told {
    /// Receives a text of the vehicle.
    pub(super) fn text(&mut self, text: &str) {
        let reason = ARMING_TEXTS.iter().find_map(|w| text.strip_prefix(w));
        if let Some(reason) = reason {
            self.not_armed = Some(reason.to_owned());
        }
    }

    /// What ends the vehicle's landing sequence, where that keeps it from arming.
    pub(super) fn cure(&self) -> Option<&'static str> {
        let reason = self.not_armed.as_ref()?.to_lowercase();
        reason.contains(IN_LANDING).then_some(END_LANDING)
    }

    fn is_complete(&self, told: &BTreeMap<String, f64>, known: &Parameters) -> bool {
        let told = |name: &&str| told.contains_key(*name);
        let mut altitudes = known.home_altitude.iter().map(|(name, _)| name);
        self.gps.is_some()
            && self.ekf.is_some()
            && self.status.is_some()
            && self.home.is_some()
            && known.rules.iter().all(|rule| told(&rule.name))
            && (known.station.is_empty() || known.station.iter().any(told))
            && altitudes.any(told)
    }
}

/// The list of one vehicle.
#[derive(Debug, Clone)]
pub(super) struct Checklist {
    profile: &'static Profile,
    expected: Option<Expectation>,
    own_id: u8,
    may_arm: bool,
    pub told: Told,
    done: bool,
}

impl Checklist {
    pub(super) fn new(config: &BridgeConfig) -> Self {
        Self {
            profile: config.profile,
            expected: config.expectation.clone(),
            own_id: config.system_id,
            may_arm: config.may_arm,
            told: Told {
                eas_over_tas: 1.0,
                ..Told::default()
            },
            done: config.expectation.is_none(),
        }
    }

    /// The list of a vehicle of another profile, with what is known already.
    pub(super) fn adopt(&mut self, profile: &'static Profile) {
        self.profile = profile;
    }

    /// Whether there is a list.
    pub(super) fn is_kept(&self) -> bool {
        self.expected.is_some()
    }

    /// The parameters that are asked for: those of the list, or those that tell what becomes of the vehicle
    /// without its bridge.
    pub(super) fn parameters(&self) -> Vec<&'static str> {
        let known = &self.profile.parameters;
        let kept = self.is_kept();
        let rules = known.rules.iter().filter(|r| kept || r.link_failsafe);
        let mut names: Vec<&str> = rules.map(|r| r.name).collect();
        if !known.take_off_altitude.is_empty() {
            names.push(known.take_off_altitude);
        }
        if kept {
            names.extend(known.station);
            names.extend(known.home_altitude.iter().map(|(name, _)| *name));
            names.extend(known.airspeed_min.iter().chain(known.airspeed_max));
        }
        names
    }

    /// Whether the checklist is complete, or there is none.
    pub(super) fn is_done(&self) -> bool {
        self.done
    }

    /// The list, once all is told or waited for long enough since the vehicle was heard.
    pub(super) fn due(
        &mut self,
        parameters: &BTreeMap<String, f64>,
        heard: SimTime,
        now: SimTime,
    ) -> Option<Vec<Point>> {
        let waited = now.since_s(heard) >= WAIT_S;
        let known = &self.profile.parameters;
        if self.done || !(waited || self.told.is_complete(parameters, known)) {
            return None;
        }
        self.done = true;
        Some(self.points(parameters))
    }

    /// Reasons against a take-off now, as text; none if it is allowed.
    pub(super) fn refusals(&self, parameters: &BTreeMap<String, f64>) -> Option<String> {
        let points = self.points(parameters);
        let refused = points.iter().filter(|p| p.verdict == Verdict::Refused);
        let words: Vec<String> = refused
            .map(|p| format!("{}: {}", p.about, p.words))
            .collect();
        (!words.is_empty()).then(|| words.join("; "))
    }

    /// Wrong parameters, with their expected values.
    pub(super) fn wrong_parameters(
        &self,
        parameters: &BTreeMap<String, f64>,
    ) -> Vec<(&'static str, f64)> {
        let known = &self.profile.parameters;
        let stations = known.station.iter();
        let rules = known.rules.iter();
        rules
            .filter_map(|rule| Some((rule.name, rule.set_to?)))
            .chain(stations.map(|name| (*name, f64::from(self.own_id))))
            .filter(|(name, right)| parameters.get(*name).is_some_and(|is| is != right))
            .collect()
    }

    /// The current state of every point; empty without a checklist.
    pub(super) fn points(&self, parameters: &BTreeMap<String, f64>) -> Vec<Point> {
        let Some(expected) = &self.expected else {
            return Vec::new();
        };
        let parameter = |names: &[&'static str]| {
            let told = |n: &&'static str| Some((*n, *parameters.get(*n)?));
            names.iter().find_map(told)
        };
        let known = &self.profile.parameters;
        let mode = self.profile.modes.name(self.told.custom_mode);
        let mut points = vec![
            self.gps(),
            self.ekf(),
            self.battery(),
            point("mode", Verdict::Right, mode),
            self.arming(),
            self.home(expected),
            self.ground(expected),
            airspeed(
                expected,
                self.told.eas_over_tas,
                (known.airspeed_min, parameter(known.airspeed_min)),
                (known.airspeed_max, parameter(known.airspeed_max)),
            ),
            wind(expected, self.profile.commands.ground_speed),
            self.station(parameter(known.station)),
            self.way_home(expected, parameters),
        ];
        points.extend(known.rules.iter().map(|rule| ruled(rule, parameters)));
        if !expected.fence.is_empty() {
            points.push(corners(expected.fence.len(), self.told.fence.as_ref()));
        }
        points
    }

    fn gps(&self) -> Point {
        let Some(gps) = &self.told.gps else {
            return untold("gps", "GPS_RAW_INT");
        };
        let fix = gps.fix_type as u8 >= GpsFixType::GPS_FIX_TYPE_3D_FIX as u8
            && gps.fix_type != GpsFixType::GPS_FIX_TYPE_STATIC;
        let satellites = gps.satellites_visible;
        let (verdict, then) = match fix {
            false => (Verdict::Refused, "; expected a 3D fix"),
            true if satellites < SATELLITES => (Verdict::Doubtful, "; expected 6 or more"),
            true => (Verdict::Right, ""),
        };
        let fix = if fix { "3D fix" } else { "no 3D fix" };
        point(
            "gps",
            verdict,
            format!("{fix}, {satellites} satellites{then}"),
        )
    }

    fn ekf(&self) -> Point {
        let Some(ekf) = &self.told.ekf else {
            return untold("ekf", "EKF_STATUS_REPORT or ESTIMATOR_STATUS");
        };
        let needed = EkfStatusFlags::EKF_ATTITUDE
            | EkfStatusFlags::EKF_VELOCITY_HORIZ
            | EkfStatusFlags::EKF_POS_HORIZ_ABS
            | EkfStatusFlags::EKF_POS_VERT_ABS;
        let bad = EkfStatusFlags::EKF_UNINITIALIZED | EkfStatusFlags::EKF_CONST_POS_MODE;
        if ekf.contains(needed) && !ekf.intersects(bad) {
            return point(
                "ekf",
                Verdict::Right,
                "attitude, velocity and position are estimated".into(),
            );
        }
        let words = "the estimator has no attitude, velocity or position yet; wait until it has";
        point("ekf", Verdict::Refused, words.into())
    }

    fn battery(&self) -> Point {
        let Some(battery) = self.told.batteries.lowest_for_flight() else {
            if self.told.status.is_none() {
                return untold("battery", "SYS_STATUS");
            }
            let words =
                "the vehicle does not report its charge; expected a battery monitor (BATT_MONITOR)";
            return point("battery", Verdict::Doubtful, words.into());
        };
        let (verdict, then) = match battery.left_pct {
            left if left <= BATTERY_PCT.0 => (Verdict::Refused, "; expected a higher charge"),
            left if left < BATTERY_PCT.1 => (Verdict::Doubtful, "; expected a full battery"),
            _ => (Verdict::Right, ""),
        };
        let words = format!("{battery} at {} %{then}", battery.left_pct);
        point("battery", verdict, words)
    }

    /// The vehicle's own checks before arming.
    fn arming(&self) -> Point {
        let bit = MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK;
        let told = self
            .told
            .status
            .as_ref()
            .filter(|s| s.onboard_control_sensors_enabled.contains(bit));
        let who = if self.may_arm {
            "the bridge"
        } else {
            "a person"
        };
        match told.map(|s| s.onboard_control_sensors_health.contains(bit)) {
            None => untold("arming", "its checks before arming (SYS_STATUS)"),
            Some(true) => point(
                "arming",
                Verdict::Right,
                format!("its own checks pass; {who} arms"),
            ),
            Some(false) => {
                let words = match &self.told.not_armed {
                    Some(reason) => {
                        let cure = self.told.cure().unwrap_or_default();
                        format!(
                            "its own checks fail, so it cannot be armed: {reason}{cure}. {who} arms"
                        )
                    }
                    None => format!(
                        "its own checks fail, so it cannot be armed; its PreArm messages give the reason. {who} arms"
                    ),
                };
                point("arming", Verdict::Doubtful, words)
            }
        }
    }

    fn home(&self, expected: &Expectation) -> Point {
        let Some(home) = &self.told.home else {
            return untold("home", "HOME_POSITION");
        };
        let at = Geodetic::new(
            f64::from(home.latitude) / 1e7,
            f64::from(home.longitude) / 1e7,
        );
        let off_m = distance_m(at, expected.home);
        let (verdict, then) = match off_m {
            off if off <= HOME_M.0 => (Verdict::Right, ""),
            off if off <= HOME_M.1 => (
                Verdict::Doubtful,
                "; it will take off, return and land at its own home",
            ),
            _ => (
                Verdict::Refused,
                "; expected the scenario's home for this vehicle",
            ),
        };
        point(
            "home",
            verdict,
            format!("{off_m:.0} m from the scenario's home{then}"),
        )
    }

    fn ground(&self, expected: &Expectation) -> Point {
        let Some(home) = &self.told.home else {
            return untold("ground", "HOME_POSITION");
        };
        let amsl_m = f64::from(home.altitude) / 1e3;
        let ground_m = expected.home_amsl_m;
        let (verdict, then) = if (amsl_m - ground_m).abs() <= GROUND_M {
            (Verdict::Right, "")
        } else {
            (
                Verdict::Doubtful,
                "; all heights would be wrong by the difference; expected the same datum and place",
            )
        };
        let words = format!(
            "home at {amsl_m:.0} m above mean sea level, the scenario's ground there at {ground_m:.0} m{then}"
        );
        point("ground", verdict, words)
    }

    fn station(&self, told: Option<(&'static str, f64)>) -> Point {
        let own = self.own_id;
        let names = self.profile.parameters.station;
        if names.is_empty() {
            let words = "its link failsafe accepts the heartbeat of any ground station";
            return point("ground station", Verdict::Right, words.into());
        }
        let Some((name, id)) = told else {
            return untold("ground station", &names.join(" or "));
        };
        let (verdict, then) = if id == f64::from(own) {
            (Verdict::Right, String::new())
        } else {
            let then = format!(
                "; the vehicle would not notice the loss of this bridge, which is {own}; expected {own}, or \
                 --gcs-id {id}"
            );
            (Verdict::Doubtful, then)
        };
        point("ground station", verdict, format!("{name} is {id}{then}"))
    }

    fn way_home(&self, expected: &Expectation, parameters: &BTreeMap<String, f64>) -> Point {
        let known = self.profile.parameters.home_altitude;
        let told = known
            .iter()
            .find_map(|(name, unit_m)| Some((*name, *parameters.get(*name)?, *unit_m)));
        let Some((name, value, unit_m)) = told else {
            let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
            return untold("way home", &names.join(" or "));
        };
        let above_home_m = value * unit_m;
        let home_m = self
            .told
            .home
            .as_ref()
            .map_or(expected.home_amsl_m, |h| f64::from(h.altitude) / 1e3);
        let needed_m = expected.stack_top_amsl_m + OVER_STACK_M - home_m;
        let (verdict, then) = match above_home_m {
            below if below < 0.0 => (
                Verdict::Doubtful,
                "; it returns at its current height".to_owned(),
            ),
            low if low < needed_m => {
                let then = format!(
                    "; the highest stack ends {:.0} m above home; expected {needed_m:.0} m or more, or a way \
                     home clear of it",
                    needed_m - OVER_STACK_M
                );
                (Verdict::Doubtful, then)
            }
            _ => (Verdict::Right, String::new()),
        };
        point(
            "way home",
            verdict,
            format!("{name} is {value}: {above_home_m:.0} m above home{then}"),
        )
    }
}

fn point(about: &'static str, verdict: Verdict, words: String) -> Point {
    Point {
        about,
        verdict,
        words,
    }
}

fn untold(about: &'static str, what: &str) -> Point {
    point(
        about,
        Verdict::Doubtful,
        format!("the vehicle does not report {what}"),
    )
}

/// A parameter's name and value, with the names that it may have.
type Named<'a> = (&'a [&'a str], Option<(&'a str, f64)>);

fn airspeed(expected: &Expectation, eas_over_tas: f64, low: Named, high: Named) -> Point {
    if low.0.is_empty() {
        let words = format!(
            "the mission flies at {:.1} m/s over ground; a multirotor has no least airspeed",
            expected.airspeed_m_s
        );
        return point("airspeed", Verdict::Right, words);
    }
    let ((_, Some((low_name, low))), (_, Some((high_name, high)))) = (low, high) else {
        let names = [low.0, high.0].map(|names| names.first().copied().unwrap_or_default());
        return untold("airspeed", &names.join(" and "));
    };
    let eas_m_s = expected.airspeed_m_s * eas_over_tas;
    let (verdict, then) = if (low..=high).contains(&eas_m_s) {
        (Verdict::Right, "")
    } else {
        (
            Verdict::Doubtful,
            "; it rejects such a speed and flies its own; expected search.airspeed_m_s within its range",
        )
    };
    let words = format!(
        "the mission flies at {eas_m_s:.1} m/s equivalent airspeed, the vehicle at {low:.1} to {high:.1} \
         ({low_name}, {high_name}){then}"
    );
    point("airspeed", verdict, words)
}

/// Compares the wind with the mission's airspeed. Where the mission's speed is over ground, only reports their sum, which the
/// check of the mission compares with the aircraft's limit.
fn wind(expected: &Expectation, ground_speed: bool) -> Point {
    let (wind_m_s, airspeed_m_s) = (expected.wind_m_s, expected.airspeed_m_s);
    if ground_speed {
        let words = format!(
            "up to {wind_m_s:.1} m/s expected: at {airspeed_m_s:.1} m/s over ground up to {:.1} m/s through the air",
            wind_m_s + airspeed_m_s
        );
        return point("wind", Verdict::Right, words);
    }
    let words =
        format!("up to {wind_m_s:.1} m/s expected, at an airspeed of {airspeed_m_s:.1} m/s");
    let least_m_s = expected.least_over_ground_m_s;
    if airspeed_m_s - wind_m_s >= least_m_s {
        return point("wind", Verdict::Right, words);
    }
    let words = format!("{words}; expected at least {least_m_s} m/s of ground speed against it");
    point("wind", Verdict::Doubtful, words)
}

/// The fence on board beside the mission's.
fn corners(wanted: usize, found: Option<&FenceOnBoard>) -> Point {
    let about = "corners of the fence";
    let then = "expected the mission's fence: use --set-fence or a ground station";
    match found {
        None => untold(about, "its fence"),
        Some(FenceOnBoard::None) => {
            let words = format!("no fence on board, but the mission's has {wanted}; {then}");
            point(about, Verdict::Doubtful, words)
        }
        Some(FenceOnBoard::Other(words)) => point(
            about,
            Verdict::Doubtful,
            format!("another fence is on board: {words}; {then}"),
        ),
        Some(FenceOnBoard::Same) => {
            let words = format!("the mission's {wanted} corners are on board");
            point(about, Verdict::Right, words)
        }
    }
}

/// Meaning of a parameter.
fn ruled(rule: &Rule, parameters: &BTreeMap<String, f64>) -> Point {
    let Some(value) = parameters.get(rule.name) else {
        return untold(rule.about, rule.name);
    };
    let (verdict, words) = match rule.meaning(*value) {
        Meaning::Right(words) => (Verdict::Right, words),
        Meaning::Doubtful(words) => (Verdict::Doubtful, words),
    };
    let name = rule.name;
    point(rule.about, verdict, format!("{name} is {value}: {words}"))
}

/// The list as events, one a point, and one for the whole.
pub(super) fn events(points: &[Point]) -> Vec<EventMessage> {
    let count = |verdict: Verdict| points.iter().filter(|p| p.verdict == verdict).count();
    let (doubtful, refused) = (count(Verdict::Doubtful), count(Verdict::Refused));
    let mut events: Vec<EventMessage> = points
        .iter()
        .map(|p| {
            let (severity, mark) = match p.verdict {
                Verdict::Right => (Severity::Info, "ok"),
                Verdict::Doubtful => (Severity::Warning, "doubtful"),
                Verdict::Refused => (Severity::Error, "failed"),
            };
            let text = format!("before take-off: {} ({mark}): {}", p.about, p.words);
            event(severity, "checklist", text)
        })
        .collect();
    let severity = match (doubtful, refused) {
        (0, 0) => Severity::Info,
        (_, 0) => Severity::Warning,
        _ => Severity::Error,
    };
    let then = if refused > 0 {
        "the bridge does not start a take-off"
    } else {
        "it may take off"
    };
    let text = format!(
        "before take-off: {} points checked, {doubtful} doubtful, {refused} failed: {then}",
        points.len()
    );
    events.push(event(severity, "checklist", text));
    events
}
