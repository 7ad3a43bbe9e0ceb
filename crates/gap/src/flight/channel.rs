//! The sensors of a flight: what each reads, in which unit, and how large its noise may be.

/// Number of sensor channels.
pub const CHANNELS: usize = 15;

/// One sensor channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel {
    /// Column of the flight file.
    pub column: &'static str,
    /// What it is, in words.
    pub label: &'static str,
    /// Unit of the column.
    pub unit: &'static str,
    /// SI value of one unit of the column.
    pub si: f64,
    /// Usual white noise, in the column's unit: middle of a wide prior.
    pub usual_noise: f64,
}

const fn channel(
    column: &'static str,
    label: &'static str,
    unit: &'static str,
    si: f64,
    usual_noise: f64,
) -> Channel {
    Channel {
        column,
        label,
        unit,
        si,
        usual_noise,
    }
}

const DEG: f64 = std::f64::consts::PI / 180.0;

/// Places of the channels in [`ALL`].
pub mod at {
    /// True airspeed.
    pub const AIRSPEED: usize = 0;
    /// Angle of attack.
    pub const ALPHA: usize = 1;
    /// Sideslip.
    pub const BETA: usize = 2;
    /// Roll angle; pitch and yaw follow.
    pub const ROLL: usize = 3;
    /// Roll rate; pitch rate and yaw rate follow.
    pub const ROLL_RATE: usize = 6;
    /// Specific force forward; right and down follow.
    pub const FORCE: usize = 9;
    /// Velocity over ground north; east and down follow.
    pub const VELOCITY: usize = 12;
}

/// Every channel, in the order of the measurement vector.
pub const ALL: [Channel; CHANNELS] = [
    channel("airspeed_m_s", "airspeed", "m/s", 1.0, 0.3),
    channel("angle_of_attack_deg", "angle of attack", "deg", DEG, 0.4),
    channel("sideslip_deg", "sideslip", "deg", DEG, 0.4),
    channel("roll_deg", "roll angle", "deg", DEG, 0.4),
    channel("pitch_deg", "pitch angle", "deg", DEG, 0.4),
    channel("yaw_deg", "yaw angle", "deg", DEG, 1.0),
    channel("roll_rate_deg_s", "roll rate", "deg/s", DEG, 0.5),
    channel("pitch_rate_deg_s", "pitch rate", "deg/s", DEG, 0.5),
    channel("yaw_rate_deg_s", "yaw rate", "deg/s", DEG, 0.5),
    channel("accel_x_m_s2", "specific force forward", "m/s²", 1.0, 0.15),
    channel("accel_y_m_s2", "specific force right", "m/s²", 1.0, 0.15),
    channel("accel_z_m_s2", "specific force down", "m/s²", 1.0, 0.3),
    channel("vel_north_m_s", "velocity north", "m/s", 1.0, 0.3),
    channel("vel_east_m_s", "velocity east", "m/s", 1.0, 0.3),
    channel("vel_down_m_s", "velocity down", "m/s", 1.0, 0.3),
];
