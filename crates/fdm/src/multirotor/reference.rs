//! The point that a multirotor follows: it moves along the commanded path with bounded speed and acceleration.

/// How fast the point closes in on its end, 1/s.
const APPROACH_RAD_S: f64 = 1.0;
/// How far the vehicle may lag behind before the point slows down, and at which it stands still, m.
const LEAD_M: (f64, f64) = (2.0, 5.0);
/// Nearer than this, the point is at its end, m.
const ARRIVED_M: f64 = 0.01;

/// Speeds at which the point may move.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    /// Along the path over ground, m/s.
    pub speed_m_s: f64,
    /// Up and down, m/s.
    pub climb_m_s: f64,
    pub descent_m_s: f64,
    /// m/s².
    pub acceleration_m_s2: f64,
}

/// A moving point, NED, m and m/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Reference {
    pub pos: [f64; 3],
    pub vel: [f64; 3],
    pub acc: [f64; 3],
}

impl Reference {
    /// A point at rest where the vehicle is, or one that moves with it.
    pub fn at(pos: [f64; 3], vel: [f64; 3]) -> Self {
        Self {
            pos,
            vel,
            acc: [0.0; 3],
        }
    }

    /// Moves straight to a place and stops there.
    pub fn go_to(&mut self, dt: f64, place: &[f64; 3], pace: &Pace, lag_m: f64) {
        let off: [f64; 3] = std::array::from_fn(|k| place[k] - self.pos[k]);
        let distance = off.iter().map(|d| d * d).sum::<f64>().sqrt();
        if distance < ARRIVED_M {
            self.pos = *place;
            return self.accelerate(dt, &[0.0; 3], pace);
        }
        let direction = off.map(|d| d / distance);
        let level = direction[0].hypot(direction[1]);
        let vertical = if direction[2] < 0.0 {
            pace.climb_m_s
        } else {
            pace.descent_m_s
        };
        // Half the acceleration for braking leaves the other half for the corners of the speed's profile.
        let braking = (pace.acceleration_m_s2 * distance).sqrt();
        let speed = (pace.speed_m_s / level.max(1e-9))
            .min(vertical / direction[2].abs().max(1e-9))
            .min(braking)
            .min(APPROACH_RAD_S * distance);
        self.accelerate(dt, &direction.map(|d| d * speed * share(lag_m)), pace);
    }

    /// Moves at a horizontal velocity, and to a height.
    pub fn move_on(&mut self, dt: f64, level: [f64; 2], down_m: f64, pace: &Pace, lag_m: f64) {
        let share = share(lag_m);
        let sink =
            (APPROACH_RAD_S * (down_m - self.pos[2])).clamp(-pace.climb_m_s, pace.descent_m_s);
        self.accelerate(
            dt,
            &[level[0] * share, level[1] * share, sink * share],
            pace,
        );
    }

    /// Sinks where it is.
    pub fn sink(&mut self, dt: f64, sink_m_s: f64, pace: &Pace) {
        self.accelerate(dt, &[0.0, 0.0, sink_m_s], pace);
    }

    fn accelerate(&mut self, dt: f64, wanted: &[f64; 3], pace: &Pace) {
        let change: [f64; 3] = std::array::from_fn(|k| wanted[k] - self.vel[k]);
        let size = change.iter().map(|d| d * d).sum::<f64>().sqrt();
        let most = pace.acceleration_m_s2 * dt;
        let scale = if size > most { most / size } else { 1.0 };
        let before = self.vel;
        self.acc = change.map(|d| scale * d / dt);
        self.vel = std::array::from_fn(|k| before[k] + scale * change[k]);
        self.pos = std::array::from_fn(|k| self.pos[k] + 0.5 * (before[k] + self.vel[k]) * dt);
    }
}

/// Share of the speed that is left for a point that the vehicle follows at a distance.
fn share(lag_m: f64) -> f64 {
    let (from, to) = LEAD_M;
    ((to - lag_m) / (to - from)).clamp(0.0, 1.0)
}
