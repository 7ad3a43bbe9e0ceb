//! Attitudes and velocities as robotics has them (REP 103): the world's axes are east, north and up, a vehicle's are
//! forward, left and up.

use protocol::message::State;

/// An attitude: x, y, z and w of the quaternion that turns the vehicle's axes into the world's.
pub fn quaternion(state: &State) -> [f64; 4] {
    // Yaw counts from east to the left, pitch nose down, roll right wing down.
    let half = |deg: f64| (deg.to_radians() / 2.0).sin_cos();
    let (sin_y, cos_y) = half(90.0 - state.heading_deg);
    let (sin_p, cos_p) = half(-state.pitch_deg);
    let (sin_r, cos_r) = half(state.roll_deg);
    [
        sin_r * cos_p * cos_y - cos_r * sin_p * sin_y,
        cos_r * sin_p * cos_y + sin_r * cos_p * sin_y,
        cos_r * cos_p * sin_y - sin_r * sin_p * cos_y,
        cos_r * cos_p * cos_y + sin_r * sin_p * sin_y,
    ]
}

/// The velocity over ground towards east, north and up, m/s.
pub fn velocity_enu(state: &State) -> [f64; 3] {
    let [north, east, down] = state.vel_ned_m_s;
    // Level flight goes up by 0, not by -0.
    [east, north, 0.0 - down]
}

/// A vector in the world's axes as the vehicle has it.
pub fn into_body(quaternion: [f64; 4], vector: [f64; 3]) -> [f64; 3] {
    let [x, y, z, w] = quaternion;
    turned([-x, -y, -z, w], vector)
}

/// A vector turned by a quaternion: v + 2 q × (q × v + w v).
fn turned([x, y, z, w]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let q = [x, y, z];
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let inner = cross(q, v);
    let inner = [0, 1, 2].map(|k| inner[k] + w * v[k]);
    let outer = cross(q, inner);
    [0, 1, 2].map(|k| v[k] + 2.0 * outer[k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use protocol::message::VehicleKind;

    fn state(roll_deg: f64, pitch_deg: f64, heading_deg: f64) -> State {
        State {
            kind: VehicleKind::Simulated,
            lat_deg: 43.4,
            lon_deg: -7.8,
            alt_amsl_m: 800.0,
            vel_ned_m_s: [0.0; 3],
            roll_deg,
            pitch_deg,
            heading_deg,
            airspeed_m_s: 18.0,
            throttle: 0.5,
            airborne: true,
        }
    }

    /// Where the nose and the left wing point, towards east, north and up.
    fn axes(state: &State) -> [[f64; 3]; 2] {
        let q = quaternion(state);
        [turned(q, [1.0, 0.0, 0.0]), turned(q, [0.0, 1.0, 0.0])]
    }

    proptest! {
        /// By the definition of the angles, not by quaternions: the nose points along heading and pitch; at no
        /// bank the left wing is level and points to heading - 90°, and a bank to the right lifts it.
        #[test]
        fn nose_and_wing_point_where_the_angles_say(
            roll in -80.0..80.0f64, pitch in -80.0..80.0f64, heading in 0.0..360.0f64,
        ) {
            let [nose, wing] = axes(&state(roll, pitch, heading));
            let (sin_h, cos_h) = heading.to_radians().sin_cos();
            let (sin_p, cos_p) = pitch.to_radians().sin_cos();
            for (is, should) in nose.iter().zip([cos_p * sin_h, cos_p * cos_h, sin_p]) {
                prop_assert!((is - should).abs() < 1e-12);
            }
            let (sin_r, cos_r) = roll.to_radians().sin_cos();
            prop_assert!((wing[2] - sin_r * cos_p).abs() < 1e-12);
            // Along the level direction to the left of the heading.
            prop_assert!((-wing[0] * cos_h + wing[1] * sin_h - cos_r).abs() < 1e-12);
            let back = into_body(quaternion(&state(roll, pitch, heading)), nose);
            prop_assert!((back[0] - 1.0).abs() < 1e-12 && back[1].abs() < 1e-12 && back[2].abs() < 1e-12);
        }
    }
}
