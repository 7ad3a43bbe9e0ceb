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

/// A parameter that is added, with its meaning still to be stated.
const fn offset(
    name: &'static str,
    unit: &'static str,
    prior_sd: f64,
    (low, high): (f64, f64),
) -> ParameterSpec {
    ParameterSpec {
        name,
        unit,
        neutral: 0.0,
        prior_sd,
        low,
        high,
        meaning: "",
    }
}

/// A factor, with its meaning still to be stated.
const fn factor(name: &'static str, prior_sd: f64, range: (f64, f64)) -> ParameterSpec {
    ParameterSpec {
        neutral: 1.0,
        ..offset(name, "1", prior_sd, range)
    }
}

impl ParameterSpec {
    const fn meaning(self, meaning: &'static str) -> Self {
        Self { meaning, ..self }
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
        &[factor("factor", 0.1, (0.3, 3.0)).meaning("logged airspeed = factor × true")],
    ),
    mechanism(
        "actuator-delay",
        Airframe,
        &[offset("delay_s", "s", 0.05, (0.0, 0.5))
            .meaning("added time from command to first motion")],
    ),
    mechanism(
        "actuator-lag",
        Airframe,
        &[offset("time_constant_s", "s", 0.05, (0.0, 1.0))
            .meaning("added first-order lag of the servos")],
    ),
    mechanism(
        "surface-trim-offset",
        Airframe,
        &[
            offset("elevator_deg", "deg", 2.0, (-15.0, 15.0))
                .meaning("actual = commanded + offset"),
            offset("aileron_deg", "deg", 2.0, (-15.0, 15.0)).meaning("actual = commanded + offset"),
            offset("rudder_deg", "deg", 2.0, (-15.0, 15.0)).meaning("actual = commanded + offset"),
        ],
    ),
    mechanism(
        "control-effectiveness",
        Airframe,
        &[
            factor("elevator_factor", 0.25, (0.05, 4.0))
                .meaning("factor on the pitching moment of the elevator"),
            factor("aileron_factor", 0.25, (0.05, 4.0))
                .meaning("factor on the rolling and yawing moment of the ailerons"),
            factor("rudder_factor", 0.25, (0.05, 4.0))
                .meaning("factor on the yawing and rolling moment of the rudder"),
        ],
    ),
    mechanism(
        "mass-change",
        Airframe,
        &[offset("added_kg", "kg", 0.3, (-5.0, 50.0))
            .meaning("mass added at the centre of gravity")],
    ),
    mechanism(
        "cg-shift",
        Airframe,
        &[offset("ahead_m", "m", 0.02, (-0.5, 0.5)).meaning("centre of gravity moved forward")],
    ),
    mechanism(
        "drag-increase",
        Airframe,
        &[offset("cd_zero", "1", 0.01, (-0.05, 0.5))
            .meaning("added to the parasite drag coefficient")],
    ),
    mechanism(
        "lift-slope",
        Airframe,
        &[factor("factor", 0.15, (0.2, 3.0)).meaning("factor on the lift slope")],
    ),
    mechanism(
        "thrust-loss",
        Airframe,
        &[offset("lost_share", "1", 0.15, (-1.0, 0.95))
            .meaning("fraction of the thrust that is lost")],
    ),
    mechanism(
        "roll-damping",
        Airframe,
        &[factor("factor", 0.25, (0.05, 5.0)).meaning("factor on the roll damping")],
    ),
    mechanism(
        "pitch-damping",
        Airframe,
        &[factor("factor", 0.25, (0.05, 5.0)).meaning("factor on the pitch damping")],
    ),
    mechanism(
        "wind-bias",
        Air,
        &[
            offset("north_m_s", "m/s", 2.0, (-30.0, 30.0))
                .meaning("added to the wind vector (towards north)"),
            offset("east_m_s", "m/s", 2.0, (-30.0, 30.0))
                .meaning("added to the wind vector (towards east)"),
        ],
    ),
    mechanism(
        "gyro-bias",
        Sensors,
        &[
            offset("roll_deg_s", "deg/s", 1.0, (-20.0, 20.0)).meaning("logged = true + bias"),
            offset("pitch_deg_s", "deg/s", 1.0, (-20.0, 20.0)).meaning("logged = true + bias"),
            offset("yaw_deg_s", "deg/s", 1.0, (-20.0, 20.0)).meaning("logged = true + bias"),
        ],
    ),
    mechanism(
        "accelerometer-bias",
        Sensors,
        &[
            offset("x_m_s2", "m/s²", 0.3, (-5.0, 5.0)).meaning("logged = true + bias, forward"),
            offset("y_m_s2", "m/s²", 0.3, (-5.0, 5.0)).meaning("logged = true + bias, right"),
            offset("z_m_s2", "m/s²", 0.3, (-5.0, 5.0)).meaning("logged = true + bias, down"),
        ],
    ),
    mechanism(
        "alpha-vane-scale",
        Sensors,
        &[
            factor("factor", 0.2, (0.2, 4.0)).meaning("logged = factor × true + offset"),
            offset("offset_deg", "deg", 2.0, (-15.0, 15.0))
                .meaning("logged = factor × true + offset"),
        ],
    ),
];

/// The mechanism of this name.
pub fn spec(id: &str) -> Option<&'static MechanismSpec> {
    CATALOGUE.iter().find(|spec| spec.id == id)
}
