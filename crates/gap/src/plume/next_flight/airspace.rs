//! Whether a plan keeps within the scenario's airspace.

use air::area::{distance_to_segment_m, is_inside};
use air::geo::Enu;

use super::super::data::Setup;
use super::axis::PlumeAxis;
use super::plans::Plan;

/// What of the airspace the plan does not keep to, in words; nothing where it does. Its heights do.
pub(super) fn outside(setup: &Setup, axis: PlumeAxis, plan: &Plan) -> Option<String> {
    let fence = &setup.airspace;
    let level = |point: &[f64; 3]| {
        let place = axis.place(setup, *point);
        Enu {
            east_m: place.east_m,
            north_m: place.north_m,
        }
    };
    let corners: Vec<Enu> = plan.round.iter().map(level).collect();
    let mut legs = corners.iter().zip(corners.iter().cycle().skip(1));
    let is_near = |(a, b): (&Enu, &Enu)| {
        let near = |s: &Enu| distance_to_segment_m(*s, *a, *b) < fence.keep_out_m;
        fence.stacks.iter().any(near)
    };
    let mut wrong = Vec::new();
    if !corners.iter().all(|c| is_inside(&fence.polygon, *c)) {
        wrong.push("its polygon".to_string());
    }
    if legs.any(is_near) {
        wrong.push(format!("{:.0} m around the stack", fence.keep_out_m));
    }
    (!wrong.is_empty()).then(|| wrong.join(", "))
}
