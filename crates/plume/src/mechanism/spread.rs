//! How the plume spreads, and what it meets above and below.

use super::entry::{Action, Family, MechanismSpec, Steps, factor, limit, offset};

pub(super) const STABILITY_CLASS: MechanismSpec = MechanismSpec {
    name: "stability-class",
    family: Family::Spread,
    parameters: &[offset("shift", "classes", 1.0, -5.0, 5.0)],
    sign: "classes added to the scenario's, A to F; positive is more stable",
    action: Action::OnDispersion(|e, v| e.class_shift += v[0]),
    steps: Steps::Line(&[0.5, -0.5, 1.5, -1.5]),
    check: None,
};

pub(super) const SIGMA_Y_SCALE: MechanismSpec = MechanismSpec {
    name: "sigma-y-scale",
    family: Family::Spread,
    parameters: &[factor("factor", 0.35, 0.05, 20.0)],
    sign: "sigma_y = factor times Briggs' sigma_y",
    action: Action::OnDispersion(|e, v| e.sigma_y_factor *= v[0]),
    steps: Steps::Line(&[1.1, 0.6, 1.6]),
    check: None,
};

pub(super) const SIGMA_Z_SCALE: MechanismSpec = MechanismSpec {
    name: "sigma-z-scale",
    family: Family::Spread,
    parameters: &[factor("factor", 0.35, 0.05, 20.0)],
    sign: "sigma_z = factor times Briggs' sigma_z",
    action: Action::OnDispersion(|e, v| e.sigma_z_factor *= v[0]),
    steps: Steps::Line(&[1.1, 0.6, 1.6]),
    check: None,
};

pub(super) const SIGMA_Z_GROWTH: MechanismSpec = MechanismSpec {
    name: "sigma-z-growth",
    family: Family::Spread,
    parameters: &[offset("exponent", "1", 0.3, -1.5, 1.5)],
    sign: "sigma_z times (x / 1000 m)^exponent",
    action: Action::OnDispersion(|e, v| e.sigma_z_exponent += v[0]),
    steps: Steps::Line(&[0.15, -0.5, 0.5]),
    check: None,
};

pub(super) const EFFECTIVE_HEIGHT_OFFSET: MechanismSpec = MechanismSpec {
    name: "effective-height-offset",
    family: Family::Spread,
    parameters: &[offset("offset_m", "m", 50.0, -1000.0, 1000.0)],
    sign: "added to the effective height H of every source",
    action: Action::OnDispersion(|e, v| e.height_offset_m += v[0]),
    steps: Steps::Line(&[3.0, -25.0, 25.0]),
    check: Some("the plume's height from a lidar or cameras"),
};

pub(super) const GROUND_REFLECTION: MechanismSpec = MechanismSpec {
    name: "ground-reflection",
    family: Family::Spread,
    parameters: &[offset("coefficient", "1", 1.0, 0.0, 1.0)],
    sign: "fraction of the plume that the ground reflects: 0 none, 1 all",
    action: Action::OnDispersion(|e, v| e.ground_coefficient += v[0]),
    steps: Steps::Line(&[0.5]),
    check: None,
};

pub(super) const MIXING_LID: MechanismSpec = MechanismSpec {
    name: "mixing-lid",
    family: Family::Spread,
    parameters: &[limit("height_m", "m AGL", 700.0, 10.0, 10_000.0)],
    sign: "height above ground of a lid that reflects the plume; no gas passes it, and a plume above it is \
           unaffected",
    action: Action::OnDispersion(|e, v| e.lid_m = e.lid_m.min(v[0])),
    steps: Steps::HeightsAboveAxis,
    check: None,
};
