//! Stability margins of the outer loops, measured: a small sine on a demand, and what the whole
//! simulated aircraft with its controller makes of it.
//!
//! Each outer loop compares its demand r with a measured y, so its open-loop response is
//! y / (r − y), with every other loop closed, and with all holds, delays, filters and servos as
//! they are.

use nalgebra::Complex;

use super::flights::{START_AMSL_M, TICK_S, begin, tick_of};
use super::margins::{LoopMargin, frequencies, of_response};
use crate::aircraft::{Aircraft, ControlGains};
use crate::autopilot::{Demand, Path};
use crate::error::FdmError;
use crate::state::{AirAround, FlightState};
use std::sync::Arc;

/// Frequencies a loop.
const FREQUENCIES: usize = 16;
/// Time until the start is forgotten, s.
const SETTLE_S: f64 = 30.0;
/// Least time over which a sine is correlated, s.
const CORRELATE_S: f64 = 10.0;

/// A loop with a demand of its own.
struct OuterLoop {
    name: &'static str,
    range_rad_s: (f64, f64),
    /// Small enough that no rate limit acts.
    amplitude: f64,
    /// The demand moved by so much.
    demand: fn(&mut Demand, f64),
    value: fn(&FlightState) -> f64,
    /// What the value is when the demand is not moved.
    reference: fn(&Aircraft) -> f64,
}

const LOOPS: [OuterLoop; 3] = [
    OuterLoop {
        name: "heading",
        range_rad_s: (0.15, 12.0),
        amplitude: 0.2,
        demand: |demand, deg| demand.path = Path::Heading { deg },
        value: |s| s.yaw_rad.to_degrees(),
        reference: |_| 0.0,
    },
    OuterLoop {
        name: "height",
        range_rad_s: (0.1, 6.0),
        amplitude: 0.1,
        demand: |demand, m| demand.alt_amsl_m += m,
        value: |s| s.alt_amsl_m,
        reference: |_| START_AMSL_M,
    },
    OuterLoop {
        name: "airspeed",
        range_rad_s: (0.1, 6.0),
        amplitude: 0.05,
        demand: |demand, m_s| demand.airspeed_m_s += m_s,
        value: |s| s.airspeed_m_s,
        reference: |a| a.limits.airspeed_cruise_m_s,
    },
];

/// Margins of the heading, height and airspeed loop at cruise in calm air.
pub(super) fn margins(
    aircraft: &Arc<Aircraft>,
    gains: &ControlGains,
) -> Result<Vec<LoopMargin>, FdmError> {
    let cruise = aircraft.limits.airspeed_cruise_m_s;
    LOOPS
        .iter()
        .map(|outer| {
            let points = frequencies(outer.range_rad_s, FREQUENCIES)
                .map(|w| respond(aircraft, gains, outer, w))
                .collect::<Result<Vec<_>, _>>()?;
            Ok(of_response(outer.name, cruise, &points))
        })
        .collect()
}

/// The open-loop response near a frequency: at one whose period is a whole number of ticks.
fn respond(
    aircraft: &Arc<Aircraft>,
    gains: &ControlGains,
    outer: &OuterLoop,
    near_rad_s: f64,
) -> Result<(f64, Complex<f64>), FdmError> {
    let period = (std::f64::consts::TAU / near_rad_s / TICK_S)
        .round()
        .max(8.0);
    let frequency = std::f64::consts::TAU / (period * TICK_S);
    let periods = (CORRELATE_S / (period * TICK_S)).ceil();
    let settle = ((SETTLE_S / TICK_S / period).ceil() * period) as u32;
    let correlate = (periods * period) as u32;
    let (mut sim, mut pilot) = begin(aircraft, gains)?;
    let level = Demand {
        path: Path::Heading { deg: 0.0 },
        alt_amsl_m: START_AMSL_M,
        airspeed_m_s: aircraft.limits.airspeed_cruise_m_s,
    };
    let reference = (outer.reference)(aircraft);
    let mut state = sim.state();
    let (mut asked, mut flown) = (Complex::from(0.0), Complex::from(0.0));
    for tick in 0..settle + correlate {
        let phase = f64::from(tick) * TICK_S * frequency;
        let moved = outer.amplitude * phase.sin();
        if tick >= settle {
            let turned = Complex::new(phase.cos(), -phase.sin());
            asked += turned * moved;
            flown += turned * ((outer.value)(&state) - reference);
        }
        let mut demand = level;
        (outer.demand)(&mut demand, moved);
        state = tick_of(&mut sim, &mut pilot, &AirAround::STANDARD_CALM, &demand);
    }
    Ok((frequency, flown / (asked - flown)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With inner loops much faster than the heading loop, its open loop is nearly
    /// bandwidth / s (the loop turns a heading error into a rate of turn), late by the roll loop's
    /// lag 1/bandwidth + 1/damping.
    #[test]
    fn a_slow_heading_loop_crosses_over_at_its_bandwidth() {
        let mut aircraft =
            Aircraft::from_toml("x8", include_str!("../../../../aircraft/x8.toml")).unwrap();
        aircraft.control.heading_bandwidth_rad_s = 0.2;
        let aircraft = Arc::new(aircraft);
        let margins = margins(&aircraft, &aircraft.control).unwrap();
        let heading = &margins[0];
        assert!(
            (heading.crossover_rad_s / 0.2 - 1.0).abs() < 0.1,
            "{heading:?}"
        );
        assert!(
            (80.0..90.0).contains(&heading.phase_margin_deg),
            "{heading:?}"
        );
    }
}
