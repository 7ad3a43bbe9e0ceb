//! The mechanisms of flight and the sizes that physics allows them.

/// One parameter of a mechanism.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterSpec {
    /// Name in files, with its unit where it has one.
    pub name: &'static str,
    /// Unit; `"1"` for a pure number.
    pub unit: &'static str,
    /// Value at which the mechanism does nothing.
    pub neutral: f64,
    /// Physical size: standard deviation of the prior around the neutral value.
    pub prior_sd: f64,
    /// Smallest value allowed.
    pub low: f64,
    /// Largest value allowed.
    pub high: f64,
    /// What it means, with its sign.
    pub meaning: &'static str,
}

/// What a mechanism changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ActsOn {
    /// How the aircraft moves.
    Airframe,
    /// What its sensors measure.
    Sensors,
    /// The air it flies in.
    Air,
}

/// A kind of extension.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MechanismSpec {
    /// Name in files and answers.
    pub id: &'static str,
    /// What it changes.
    pub acts_on: ActsOn,
    /// Its parameters.
    pub parameters: &'static [ParameterSpec],
}

const fn parameter(
    name: &'static str,
    unit: &'static str,
    neutral: f64,
    prior_sd: f64,
    range: (f64, f64),
    meaning: &'static str,
) -> ParameterSpec {
    ParameterSpec {
        name,
        unit,
        neutral,
        prior_sd,
        low: range.0,
        high: range.1,
        meaning,
    }
}

const fn mechanism(
    id: &'static str,
    acts_on: ActsOn,
    parameters: &'static [ParameterSpec],
) -> MechanismSpec {
    MechanismSpec {
        id,
        acts_on,
        parameters,
    }
}

use ActsOn::{Air, Airframe, Sensors};

/// Every mechanism of flight.
pub const CATALOGUE: &[MechanismSpec] = &[
    mechanism(
        "airspeed-scale",
        Sensors,
        &[parameter(
            "factor",
            "1",
            1.0,
            0.1,
            (0.3, 3.0),
            "logged airspeed = factor × true",
        )],
    ),
    mechanism(
        "actuator-delay",
        Airframe,
        &[parameter(
            "delay_s",
            "s",
            0.0,
            0.05,
            (0.0, 0.5),
            "added time from command to first motion",
        )],
    ),
    mechanism(
        "actuator-lag",
        Airframe,
        &[parameter(
            "time_constant_s",
            "s",
            0.0,
            0.05,
            (0.0, 1.0),
            "added first-order lag of the servos",
        )],
    ),
    mechanism(
        "surface-trim-offset",
        Airframe,
        &[
            parameter(
                "elevator_deg",
                "deg",
                0.0,
                2.0,
                (-15.0, 15.0),
                "actual = commanded + offset",
            ),
            parameter(
                "aileron_deg",
                "deg",
                0.0,
                2.0,
                (-15.0, 15.0),
                "actual = commanded + offset",
            ),
            parameter(
                "rudder_deg",
                "deg",
                0.0,
                2.0,
                (-15.0, 15.0),
                "actual = commanded + offset",
            ),
        ],
    ),
    mechanism(
        "control-effectiveness",
        Airframe,
        &[
            parameter(
                "elevator_factor",
                "1",
                1.0,
                0.25,
                (0.05, 4.0),
                "factor on the pitching moment of the elevator",
            ),
            parameter(
                "aileron_factor",
                "1",
                1.0,
                0.25,
                (0.05, 4.0),
                "factor on the rolling and yawing moment of the ailerons",
            ),
            parameter(
                "rudder_factor",
                "1",
                1.0,
                0.25,
                (0.05, 4.0),
                "factor on the yawing and rolling moment of the rudder",
            ),
        ],
    ),
    mechanism(
        "mass-change",
        Airframe,
        &[parameter(
            "added_kg",
            "kg",
            0.0,
            0.3,
            (-5.0, 50.0),
            "mass added at the centre of gravity",
        )],
    ),
    mechanism(
        "cg-shift",
        Airframe,
        &[parameter(
            "ahead_m",
            "m",
            0.0,
            0.02,
            (-0.5, 0.5),
            "centre of gravity moved forward",
        )],
    ),
    mechanism(
        "drag-increase",
        Airframe,
        &[parameter(
            "cd_zero",
            "1",
            0.0,
            0.01,
            (-0.05, 0.5),
            "added to the parasite drag coefficient",
        )],
    ),
    mechanism(
        "lift-slope",
        Airframe,
        &[parameter(
            "factor",
            "1",
            1.0,
            0.15,
            (0.2, 3.0),
            "factor on the lift slope",
        )],
    ),
    mechanism(
        "thrust-loss",
        Airframe,
        &[parameter(
            "lost_share",
            "1",
            0.0,
            0.15,
            (-1.0, 0.95),
            "fraction of the thrust that is lost",
        )],
    ),
    mechanism(
        "roll-damping",
        Airframe,
        &[parameter(
            "factor",
            "1",
            1.0,
            0.25,
            (0.05, 5.0),
            "factor on the roll damping",
        )],
    ),
    mechanism(
        "pitch-damping",
        Airframe,
        &[parameter(
            "factor",
            "1",
            1.0,
            0.25,
            (0.05, 5.0),
            "factor on the pitch damping",
        )],
    ),
    mechanism(
        "wind-bias",
        Air,
        &[
            parameter(
                "north_m_s",
                "m/s",
                0.0,
                2.0,
                (-30.0, 30.0),
                "added to the wind vector (towards north)",
            ),
            parameter(
                "east_m_s",
                "m/s",
                0.0,
                2.0,
                (-30.0, 30.0),
                "added to the wind vector (towards east)",
            ),
        ],
    ),
    mechanism(
        "gyro-bias",
        Sensors,
        &[
            parameter(
                "roll_deg_s",
                "deg/s",
                0.0,
                1.0,
                (-20.0, 20.0),
                "logged = true + bias",
            ),
            parameter(
                "pitch_deg_s",
                "deg/s",
                0.0,
                1.0,
                (-20.0, 20.0),
                "logged = true + bias",
            ),
            parameter(
                "yaw_deg_s",
                "deg/s",
                0.0,
                1.0,
                (-20.0, 20.0),
                "logged = true + bias",
            ),
        ],
    ),
    mechanism(
        "accelerometer-bias",
        Sensors,
        &[
            parameter(
                "x_m_s2",
                "m/s²",
                0.0,
                0.3,
                (-5.0, 5.0),
                "logged = true + bias, forward",
            ),
            parameter(
                "y_m_s2",
                "m/s²",
                0.0,
                0.3,
                (-5.0, 5.0),
                "logged = true + bias, right",
            ),
            parameter(
                "z_m_s2",
                "m/s²",
                0.0,
                0.3,
                (-5.0, 5.0),
                "logged = true + bias, down",
            ),
        ],
    ),
    mechanism(
        "alpha-vane-scale",
        Sensors,
        &[
            parameter(
                "factor",
                "1",
                1.0,
                0.2,
                (0.2, 4.0),
                "logged = factor × true + offset",
            ),
            parameter(
                "offset_deg",
                "deg",
                0.0,
                2.0,
                (-15.0, 15.0),
                "logged = factor × true + offset",
            ),
        ],
    ),
];

/// The mechanism of this name.
pub fn spec(id: &str) -> Option<&'static MechanismSpec> {
    CATALOGUE.iter().find(|spec| spec.id == id)
}
