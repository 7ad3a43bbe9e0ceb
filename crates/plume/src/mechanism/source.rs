//! What is emitted, where, and what is lost on the way.

use super::entry::{Action, Family, MechanismSpec, Steps, factor, offset, setting};
use crate::effects::SecondSource as Copied;

pub(super) const EMISSION_SCALE: MechanismSpec = MechanismSpec {
    name: "emission-scale",
    family: Family::Source,
    parameters: &[factor("factor", 0.5, 0.01, 100.0)],
    sign: "emission (or c_max) of every source times factor",
    action: Action::OnDispersion(|e, v| e.emission_factor *= v[0]),
    steps: Steps::Line(&[1.1, 0.5]),
    check: Some("the emission from the plant's own monitor"),
};

pub(super) const EMISSION_TREND: MechanismSpec = MechanismSpec {
    name: "emission-trend",
    family: Family::Source,
    parameters: &[offset("rate_per_h", "1/h", 1.0, -50.0, 50.0)],
    sign: "emission times exp(rate times hours since time 0), of the time when the air passed the source",
    action: Action::OnDispersion(|e, v| e.emission_trend_h += v[0]),
    steps: Steps::Line(&[0.5, -3.0, 3.0]),
    check: Some("the emission from the plant's own monitor"),
};

pub(super) const SECOND_SOURCE: MechanismSpec = MechanismSpec {
    name: "second-source",
    family: Family::Source,
    parameters: &[
        offset("east_m", "m", 1000.0, -20_000.0, 20_000.0),
        offset("north_m", "m", 1000.0, -20_000.0, 20_000.0),
        offset("ratio", "1", 0.5, 0.0, 50.0),
        setting("height_offset_m", "m", 0.0, -1000.0, 1000.0),
    ],
    sign: "a copy of the first source: displacement east and north, emission as a ratio to the first, effective height above the first's",
    action: Action::OnDispersion(|e, v| {
        e.second_sources.push(Copied {
            east_m: v[0],
            north_m: v[1],
            ratio: v[2],
            height_offset_m: v[3],
        });
    }),
    steps: Steps::PlacesAroundSource,
    check: None,
};

pub(super) const SOURCE_POSITION_OFFSET: MechanismSpec = MechanismSpec {
    name: "source-position-offset",
    family: Family::Source,
    parameters: &[
        offset("east_m", "m", 100.0, -5000.0, 5000.0),
        offset("north_m", "m", 100.0, -5000.0, 5000.0),
    ],
    sign: "added to the place of every source",
    action: Action::OnDispersion(|e, v| {
        e.source_east_m += v[0];
        e.source_north_m += v[1];
    }),
    steps: Steps::Plane(15.0),
    check: Some("a survey of the source's position"),
};

pub(super) const FIRST_ORDER_DECAY: MechanismSpec = MechanismSpec {
    name: "first-order-decay",
    family: Family::Source,
    parameters: &[offset("rate_per_s", "1/s", 5e-4, 0.0, 0.1)],
    sign: "excess times exp(-rate times travel time)",
    action: Action::OnDispersion(|e, v| e.decay_s += v[0]),
    steps: Steps::Line(&[2e-4, 1.5e-3]),
    check: Some("the lifetime of the gas in a bag of plume air"),
};

pub(super) const DRY_DEPOSITION: MechanismSpec = MechanismSpec {
    name: "dry-deposition",
    family: Family::Source,
    parameters: &[offset("velocity_m_s", "m/s", 0.15, 0.0, 5.0)],
    sign: "deposition velocity at the ground, positive for a loss (source depletion)",
    action: Action::OnDispersion(|e, v| e.deposition_m_s += v[0]),
    steps: Steps::Line(&[0.02, 0.3]),
    check: Some("the flux into the ground from a chamber or eddy covariance"),
};

pub(super) const BUILDING_DOWNWASH: MechanismSpec = MechanismSpec {
    name: "building-downwash",
    family: Family::Source,
    parameters: &[offset("area_m2", "m2", 5000.0, 0.0, 1e6)],
    sign: "frontal area A of the building: sigma_y^2 and sigma_z^2 grow by A / (2 pi)",
    // Gifford (1975): c A / pi with c = 1/2.
    action: Action::OnDispersion(|e, v| e.wake_var_m2 += v[0] / (2.0 * std::f64::consts::PI)),
    steps: Steps::Line(&[2000.0, 15_000.0]),
    check: None,
};
