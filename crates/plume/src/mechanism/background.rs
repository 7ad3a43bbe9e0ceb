//! The gas that was there before.

use super::entry::{Action, Family, MechanismSpec, Steps, offset};

pub(super) const OFFSET: MechanismSpec = MechanismSpec {
    name: "background-offset",
    family: Family::Background,
    parameters: &[offset("offset_ppm", "ppm", 10.0, -1e4, 1e4)],
    sign: "added to the scenario's background",
    action: Action::OnDispersion(|e, v| e.background_ppm += v[0]),
    steps: Steps::Line(&[1.0]),
    check: Some("a monitor upwind of the source"),
};

pub(super) const DRIFT: MechanismSpec = MechanismSpec {
    name: "background-drift",
    family: Family::Background,
    parameters: &[offset("rate_ppm_per_h", "ppm/h", 20.0, -1e4, 1e4)],
    sign: "added to the background: rate times hours since time 0",
    action: Action::OnDispersion(|e, v| e.background_ppm_h += v[0]),
    steps: Steps::Line(&[10.0]),
    check: Some("a monitor upwind of the source"),
};

pub(super) const GRADIENT: MechanismSpec = MechanismSpec {
    name: "background-gradient",
    family: Family::Background,
    parameters: &[
        offset("east_ppm_per_km", "ppm/km", 3.0, -1e3, 1e3),
        offset("north_ppm_per_km", "ppm/km", 3.0, -1e3, 1e3),
    ],
    sign: "added to the background: gradient times distance east and north of the site's origin",
    action: Action::OnDispersion(|e, v| {
        e.background_east_ppm_m += v[0] / 1000.0;
        e.background_north_ppm_m += v[1] / 1000.0;
    }),
    steps: Steps::Plane(1.0),
    check: Some("a monitor upwind of the source"),
};
