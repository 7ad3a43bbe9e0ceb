//! Tilt, heading and rates of a multirotor, and which rotor turns how fast for them.

use super::rotors::ROTORS;
use super::{Multirotor, MultirotorGains};
use crate::dynamics::{Body, rotation};

/// Fastest roll and pitch rate commanded, rad/s.
const TILT_RATE_RAD_S: f64 = 4.0;
/// Fastest yaw rate commanded, rad/s.
const YAW_RATE_RAD_S: f64 = 1.2;
/// Largest integral of a rate error, as the angular acceleration that it asks for, rad/s².
const INTEGRAL_RAD_S2: f64 = 10.0;
/// Share of the thrust's range that yaw may take from one rotor.
const YAW_SHARE: f64 = 0.2;

/// What the outer loops ask for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThrustDemand {
    /// Specific force of the rotors, NED, m/s²: its direction is where the shafts point.
    pub specific_force_ned_m_s2: [f64; 3],
    /// Heading, rad.
    pub yaw_rad: f64,
}

/// The memory of the rate loops.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct InnerLoops {
    /// Integral of the rate error, rad.
    integral: [f64; 3],
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

impl InnerLoops {
    /// Speed command of each rotor, rad/s.
    pub fn step(
        &mut self,
        dt: f64,
        aircraft: &Multirotor,
        body: &Body,
        density: f64,
        flying: bool,
        demand: &ThrustDemand,
    ) -> [f64; ROTORS] {
        let gains = &aircraft.control;
        let m = rotation(&body.attitude);
        let up = [-m[0][2], -m[1][2], -m[2][2]];
        let wanted = demand.specific_force_ned_m_s2;
        let size = dot(&wanted, &wanted).sqrt();
        let rate_demand = rate_demand(gains, &m, &up, &wanted, size, demand.yaw_rad);
        let bandwidth = [gains.rate_rad_s, gains.rate_rad_s, gains.yaw_rate_rad_s];
        if !flying {
            self.integral = [0.0; 3];
        }
        let acceleration: [f64; 3] = std::array::from_fn(|k| {
            let error = rate_demand[k] - body.rate[k];
            let most = INTEGRAL_RAD_S2 / bandwidth[k];
            if flying {
                let added = self.integral[k] + gains.rate_integral_rad_s * dt * error;
                self.integral[k] = added.clamp(-most, most);
            }
            bandwidth[k] * (error + self.integral[k])
        });
        let b = &aircraft.body;
        let inertia = [b.ixx_kg_m2, b.iyy_kg_m2, b.izz_kg_m2];
        let momentum = std::array::from_fn(|k| inertia[k] * body.rate[k]);
        let gyroscopic = cross(&body.rate, &momentum);
        let moment: [f64; 3] =
            std::array::from_fn(|k| inertia[k] * acceleration[k] + gyroscopic[k]);
        // The thrust is what of the demand lies along the shafts as they are.
        let thrust_n = b.mass_kg * dot(&wanted, &up).max(0.0);
        allocate(aircraft, density, thrust_n, &moment)
    }
}

/// Body rates that turn the shafts to the wanted force and the nose to the wanted heading, rad/s.
fn rate_demand(
    gains: &MultirotorGains,
    m: &[[f64; 3]; 3],
    up: &[f64; 3],
    wanted: &[f64; 3],
    size: f64,
    yaw_rad: f64,
) -> [f64; 3] {
    let into_body = |v: &[f64; 3]| -> [f64; 3] {
        std::array::from_fn(|k| m[0][k] * v[0] + m[1][k] * v[1] + m[2][k] * v[2])
    };
    let mut turn = [0.0; 3];
    if size > 0.0 {
        let direction = wanted.map(|part| part / size);
        let axis = cross(up, &direction);
        let sine = dot(&axis, &axis).sqrt();
        let angle = sine.atan2(dot(up, &direction));
        if sine > 1e-9 {
            turn = into_body(&axis.map(|part| part * angle / sine));
        }
    }
    let yaw_now = m[1][0].atan2(m[0][0]);
    let off = air::geo::wrap_signed_rad(yaw_rad - yaw_now);
    [
        (gains.tilt_rad_s * turn[0]).clamp(-TILT_RATE_RAD_S, TILT_RATE_RAD_S),
        (gains.tilt_rad_s * turn[1]).clamp(-TILT_RATE_RAD_S, TILT_RATE_RAD_S),
        (gains.heading_rad_s * off).clamp(-YAW_RATE_RAD_S, YAW_RATE_RAD_S),
    ]
}

/// Speeds that give a thrust and a moment. Where the rotors cannot give both, roll and pitch come before thrust, and
/// thrust before yaw: an aircraft that loses its tilt loses its height as well.
fn allocate(
    aircraft: &Multirotor,
    density: f64,
    thrust_n: f64,
    moment: &[f64; 3],
) -> [f64; ROTORS] {
    let rotors = &aircraft.rotors;
    let low_n = rotors.thrust_n(rotors.idle_rad_s, 0.0, density);
    let high_n = rotors.thrust_n(rotors.max_rad_s, 0.0, density);
    let count = ROTORS as f64;
    let tilt: [f64; ROTORS] = std::array::from_fn(|k| {
        let [x, y, _] = rotors.place_m(k);
        moment[1] * x / (count * rotors.forward_m * rotors.forward_m)
            - moment[0] * y / (count * rotors.right_m * rotors.right_m)
    });
    let yaw_n = moment[2] / (count * rotors.torque_over_thrust_m());
    let yaw_n = yaw_n.clamp(-YAW_SHARE * (high_n - low_n), YAW_SHARE * (high_n - low_n));
    let parts: [f64; ROTORS] = std::array::from_fn(|k| tilt[k] + rotors.torque_sign(k) * yaw_n);
    let least = parts.iter().copied().fold(f64::INFINITY, f64::min);
    let most = parts.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // All parts shrink together where their spread exceeds what a rotor has.
    let scale = ((high_n - low_n) / (most - least).max(1e-9)).min(1.0);
    let room = (low_n - scale * least, high_n - scale * most);
    let each_n = (thrust_n / count).clamp(room.0.min(room.1), room.1.max(room.0));
    parts.map(|part| {
        let wanted_n = (each_n + scale * part).clamp(low_n, high_n);
        rotors.speed_for(wanted_n, 0.0, density)
    })
}
