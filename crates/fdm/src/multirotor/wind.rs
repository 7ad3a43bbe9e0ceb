//! The wind from the drag that the accelerometers show: in body axes the rotors' thrust has no part along the forward
//! and right axes, so that what is felt there is drag (Martin & Salaün 2010, doi 10.1109/ROBOT.2010.5509980).

use super::MultirotorSim;
use crate::dynamics::rotation;

/// Time over which the estimate follows, s.
const FOLLOW_S: f64 = 1.0;
/// Rounds that find the flow from its drag.
const ROUNDS: usize = 12;

/// Cosine of the steepest tilt at which the level part of the flow is sought.
const LEAST_LEVEL: f64 = 0.3;

/// A wind estimate: north and east, towards, m/s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct DragWind {
    wind_m_s: [f64; 2],
    started: bool,
}

impl DragWind {
    pub fn vector(&self) -> [f64; 2] {
        self.wind_m_s
    }

    /// Takes in what the inertial sensors measure, the rotors' speeds (rad/s), and the velocity over ground.
    pub fn update(&mut self, dt_s: f64, sim: &MultirotorSim, density: f64, vel_ned: &[f64; 3]) {
        let (aircraft, state) = (sim.aircraft(), sim.state());
        let m = rotation(&state.attitude);
        let [forward, right, _] = state.specific_force_m_s2;
        let turning: f64 = sim.rotor_speeds_rad_s().iter().sum();
        let linear = aircraft.rotors.drag_n_s2_rad_m * turning;
        let drag_n = [forward, right].map(|force| -force * aircraft.body.mass_kg);
        let area = aircraft.drag.area_m2;
        // Air that moves level: what moves along the vertical is the vehicle. Of the flow through it, the level part is
        // wanted, of which drag shows the components along the forward and right axes. Drag is linear in the flow but
        // for its magnitude, which is found in rounds.
        let down = vel_ned[2];
        let det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
        let mut level = [0.0_f64; 2];
        for _ in 0..ROUNDS {
            let speed = level[0].hypot(level[1]).hypot(down);
            let along: [f64; 2] = std::array::from_fn(|k| {
                let slope = linear + 0.5 * density * area[k] * speed;
                let flow = if slope > 0.0 { drag_n[k] / slope } else { 0.0 };
                flow - m[2][k] * down
            });
            let found = [
                (m[1][1] * along[0] - m[1][0] * along[1]) / det.max(LEAST_LEVEL),
                (m[0][0] * along[1] - m[0][1] * along[0]) / det.max(LEAST_LEVEL),
            ];
            level = std::array::from_fn(|k| 0.5 * (level[k] + found[k]));
        }
        let follow = if self.started {
            1.0 - (-dt_s / FOLLOW_S).exp()
        } else {
            1.0
        };
        self.started = true;
        self.wind_m_s = std::array::from_fn(|k| {
            let now = vel_ned[k] - level[k];
            self.wind_m_s[k] + follow * (now - self.wind_m_s[k])
        });
    }
}
