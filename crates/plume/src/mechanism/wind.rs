//! How the wind carries the plume.

use super::entry::{Action, Family, MechanismSpec, Steps, factor, offset};

pub(super) const DIRECTION_OFFSET: MechanismSpec = MechanismSpec {
    name: "wind-direction-offset",
    family: Family::Wind,
    parameters: &[offset("offset_deg", "deg", 10.0, -180.0, 180.0)],
    sign: "added to the logged (or the scenario's) from-direction to get that of the transport",
    action: Action::OnDispersion(|e, v| e.direction_offset_deg += v[0]),
    steps: Steps::Line(&[0.5, -3.0, 3.0]),
    check: Some("a second wind vane at the plume's height"),
};

pub(super) const DIRECTION_DRIFT: MechanismSpec = MechanismSpec {
    name: "wind-direction-drift",
    family: Family::Wind,
    parameters: &[offset("rate_deg_per_h", "deg/h", 20.0, -720.0, 720.0)],
    sign: "added to the from-direction: rate times hours since time 0",
    action: Action::OnDispersion(|e, v| e.direction_drift_deg_h += v[0]),
    steps: Steps::Line(&[4.0, -25.0, 25.0]),
    check: Some("a second wind vane at the plume's height"),
};

pub(super) const SPEED_SCALE: MechanismSpec = MechanismSpec {
    name: "wind-speed-scale",
    family: Family::Wind,
    parameters: &[factor("factor", 0.25, 0.05, 20.0)],
    sign: "transport speed = factor times the logged (or the scenario's) speed",
    action: Action::OnDispersion(|e, v| e.speed_factor *= v[0]),
    steps: Steps::Line(&[1.1, 0.5]),
    check: Some("a second anemometer at the plume's height"),
};

pub(super) const VEER_WITH_HEIGHT: MechanismSpec = MechanismSpec {
    name: "wind-veer-with-height",
    family: Family::Wind,
    parameters: &[offset("rate_deg_per_100m", "deg/100 m", 5.0, -60.0, 60.0)],
    sign: "added to the from-direction: rate times height above the plume axis; positive turns clockwise with height",
    action: Action::OnDispersion(|e, v| e.veer_deg_100m += v[0]),
    steps: Steps::Line(&[1.0, -6.0, 6.0]),
    check: None,
};

pub(super) const MEANDER: MechanismSpec = MechanismSpec {
    name: "meander",
    family: Family::Wind,
    parameters: &[offset("sigma_deg", "deg", 5.0, 0.0, 45.0)],
    sign: "standard deviation of the axis direction about the one used: sigma_y^2 grows by (x sigma)^2",
    action: Action::OnDispersion(|e, v| e.meander_var_rad2 += v[0].to_radians().powi(2)),
    steps: Steps::Line(&[1.5, 4.0]),
    check: Some("the standard deviation of the direction from a wind vane at the plume's height"),
};
