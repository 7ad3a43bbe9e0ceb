//! A multirotor as a TOML file describes it: mass, four rotors, drag, limits and control gains; how it flies, and its
//! autopilot.
//!
//! Forces and moments of a rotor follow propeller theory with measured coefficients of thrust and power by advance
//! ratio; a drag across the shaft is proportional to rotor speed and cross flow (Furrer et al. 2016, RotorS,
//! doi 10.1007/978-3-319-26054-9_23). The body has a drag area along each axis. Ground effect, the vortex ring of a
//! fast descent and gyroscopic moments of the rotors are not modelled.

mod autopilot;
mod control;
mod flight;
mod inner_loops;
mod reference;
mod rotors;
mod wind;

pub use autopilot::MultirotorAutopilot;
pub use control::MultirotorGains;
pub use flight::MultirotorSim;
pub use inner_loops::ThrustDemand;
pub use rotors::{ROTORS, Rotors};

use air::isa::Atmosphere;
use serde::{Deserialize, Serialize};

use crate::aircraft::{Battery, MassProperties, OUTPUTS};
use crate::error::{FdmError, refuse};
use crate::range::{positive, within};

/// The word by which an aircraft file says that it describes a multirotor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MultirotorKind {
    /// Four rotors in an X.
    Multirotor,
}

/// A multirotor, complete and checked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Multirotor {
    /// Always `multirotor`.
    #[serde(rename = "type")]
    pub kind: MultirotorKind,
    /// Its usual name.
    pub name: String,
    /// Mass and inertia.
    pub body: MassProperties,
    /// Motors and propellers.
    pub rotors: Rotors,
    /// Drag of body, legs and payload.
    pub drag: BodyDrag,
    /// What drives the motors; none: the flight has no end by its battery.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub battery: Option<Battery>,
    /// What the autopilot commands at most.
    pub limits: MultirotorLimits,
    /// Errors of its satellite navigation and barometer.
    #[serde(default)]
    pub navigation: Navigation,
    /// Outputs of an autopilot that drive its motors.
    #[serde(default)]
    pub motors: MotorOutputs,
    /// Height of the centre of gravity above the ground at rest, m.
    pub rest_height_m: f64,
    /// Sink rate at touch-down beyond which the landing counts as hard, m/s.
    #[serde(default = "hard_sink_m_s")]
    pub hard_sink_m_s: f64,
    /// Gains of the autopilot.
    #[serde(default)]
    pub control: MultirotorGains,
}

fn hard_sink_m_s() -> f64 {
    1.5
}

/// Drag of everything but the rotors: ½ρ A |v| v along each body axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyDrag {
    /// Drag coefficient times area for flow along the forward, right and down axes, m².
    pub area_m2: [f64; 3],
}

/// What the autopilot commands at most.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MultirotorLimits {
    /// Speed over ground where none is commanded, m/s.
    pub speed_cruise_m_s: f64,
    /// Highest speed over ground, m/s.
    pub speed_max_m_s: f64,
    /// Highest airspeed that it is flown in, m/s: speed over ground and wind together.
    pub airspeed_max_m_s: f64,
    /// Fastest climb, m/s.
    pub climb_max_m_s: f64,
    /// Fastest descent, m/s.
    pub descent_max_m_s: f64,
    /// Largest tilt, degrees.
    pub tilt_max_deg: f64,
}

/// Errors of the position estimate: 1 sigma of slow errors, as they change over a minute.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Navigation {
    /// Of each horizontal component, m.
    pub horizontal_sd_m: f64,
    /// Of the height, m.
    pub vertical_sd_m: f64,
}

impl Default for Navigation {
    /// A single-band receiver and a barometer, as an ArduPilot's filter shows in flight.
    fn default() -> Self {
        Self {
            horizontal_sd_m: 0.6,
            vertical_sd_m: 0.8,
        }
    }
}

/// Outputs of an autopilot, counted from 1, in the order of ArduPilot's QUAD/X frame: front right, back left, front
/// left, back right; and their pulses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MotorOutputs {
    /// The four outputs.
    pub outputs: [usize; ROTORS],
    /// Pulse of a motor that stands still, µs.
    pub min_us: u16,
    /// Pulse of full speed, µs.
    pub max_us: u16,
}

impl Default for MotorOutputs {
    fn default() -> Self {
        Self {
            outputs: [1, 2, 3, 4],
            min_us: 1000,
            max_us: 2000,
        }
    }
}

impl MotorOutputs {
    /// Speed of each rotor as a share of the highest, 0 to 1; an output without a pulse drives none.
    pub fn speeds(&self, pulses_us: &[u16]) -> [f64; ROTORS] {
        let (low, high) = (f64::from(self.min_us), f64::from(self.max_us));
        self.outputs.map(|output| {
            let pulse = pulses_us.get(output - 1).copied().unwrap_or(0);
            ((f64::from(pulse) - low) / (high - low)).clamp(0.0, 1.0)
        })
    }

    /// The settings of an ArduCopter whose outputs these are: name and value as in a parameter file.
    pub fn ardupilot_parameters(&self) -> Vec<(String, u16)> {
        // 1 and 1: QUAD, X. Functions 33 to 36: motors 1 to 4. MOT_THST_EXPO 1 would be thrust by the square of the
        // pulse, which this model has; it is set by the user in tenths.
        let frame = [("FRAME_CLASS", 1), ("FRAME_TYPE", 1)];
        let pulses = [("MOT_PWM_MIN", self.min_us), ("MOT_PWM_MAX", self.max_us)];
        let named = frame.into_iter().chain(pulses);
        let functions = (33..)
            .zip(self.outputs)
            .map(|(function, output)| (format!("SERVO{output}_FUNCTION"), function));
        named
            .map(|(name, value)| (name.to_owned(), value))
            .chain(functions)
            .collect()
    }
}

impl Multirotor {
    /// The settings by which an ArduCopter estimates the wind from its drag, as name and value: mass over the drag area
    /// ahead and to the right, kg/m², and the deceleration by the rotors for 1 m/s across them in a hover at sea level, 1/s.
    pub fn ardupilot_drag(&self) -> [(&'static str, f64); 3] {
        let mass_kg = self.body.mass_kg;
        let ballistic = |area_m2: f64| {
            if area_m2 > 0.0 {
                mass_kg / area_m2
            } else {
                0.0
            }
        };
        let [ahead, right, _] = self.drag.area_m2.map(ballistic);
        let density_kg_m3 = Atmosphere::standard().at(0.0).density_kg_m3();
        let per_rotor_n = mass_kg * air::STANDARD_GRAVITY_M_S2 / ROTORS as f64;
        // Without flow along the shaft thrust is proportional to the square of the speed.
        let hover_rad_s = (per_rotor_n / self.rotors.thrust_n(1.0, 0.0, density_kg_m3)).sqrt();
        let rotors = ROTORS as f64 * self.rotors.drag_n_s2_rad_m * hover_rad_s / mass_kg;
        [
            ("EK3_DRAG_BCOEF_X", ahead),
            ("EK3_DRAG_BCOEF_Y", right),
            ("EK3_DRAG_MCOEF", rotors),
        ]
    }

    /// Checks every number for sign and range.
    ///
    /// # Errors
    /// [`FdmError::Refused`] for the first number that no multirotor of this model has.
    pub fn check(&self) -> Result<(), FdmError> {
        let b = &self.body;
        positive("body.mass_kg", b.mass_kg)?;
        within("body.mass_kg", b.mass_kg, 0.02, 100.0)?;
        for (key, inertia) in [
            ("body.ixx_kg_m2", b.ixx_kg_m2),
            ("body.iyy_kg_m2", b.iyy_kg_m2),
            ("body.izz_kg_m2", b.izz_kg_m2),
        ] {
            // A radius of gyration between 2 and 70 % of the distance between opposite motors: a number in another
            // unit is none of these.
            let span_m = self.rotors.forward_m.hypot(self.rotors.right_m);
            let of_span = b.mass_kg * span_m * span_m;
            within(key, inertia, 0.0016 * of_span, 2.0 * of_span)?;
        }
        within("body.ixz_kg_m2", b.ixz_kg_m2, 0.0, 0.0)?;
        within("body.cg_ahead_m", b.cg_ahead_m, 0.0, 0.0)?;
        self.rotors.check()?;
        for area in self.drag.area_m2 {
            within("drag.area_m2", area, 0.0, 10.0)?;
        }
        if let Some(battery) = &self.battery {
            battery.check()?;
        }
        self.check_limits()?;
        within(
            "navigation.horizontal_sd_m",
            self.navigation.horizontal_sd_m,
            0.0,
            20.0,
        )?;
        within(
            "navigation.vertical_sd_m",
            self.navigation.vertical_sd_m,
            0.0,
            20.0,
        )?;
        for output in self.motors.outputs {
            within("motors.outputs", output as f64, 1.0, OUTPUTS as f64)?;
        }
        let (low, high) = (f64::from(self.motors.min_us), f64::from(self.motors.max_us));
        within("motors.max_us", high, low + 1.0, 3000.0)?;
        within("rest_height_m", self.rest_height_m, 0.0, 2.0)?;
        positive("hard_sink_m_s", self.hard_sink_m_s)?;
        self.control.check()?;
        let lift_n = ROTORS as f64 * self.rotors.thrust_n(self.rotors.max_rad_s, 0.0, 1.225);
        let weight_n = b.mass_kg * air::STANDARD_GRAVITY_M_S2;
        if lift_n < LEAST_LIFT * weight_n {
            let most_kg = lift_n / (LEAST_LIFT * air::STANDARD_GRAVITY_M_S2);
            let expected =
                format!("at most {most_kg:.2}, so that its rotors lift {LEAST_LIFT} of its weight");
            return Err(refuse("body.mass_kg", b.mass_kg, expected));
        }
        Ok(())
    }

    fn check_limits(&self) -> Result<(), FdmError> {
        let l = &self.limits;
        within("limits.speed_max_m_s", l.speed_max_m_s, 1.0, 40.0)?;
        within(
            "limits.speed_cruise_m_s",
            l.speed_cruise_m_s,
            0.5,
            l.speed_max_m_s,
        )?;
        within(
            "limits.airspeed_max_m_s",
            l.airspeed_max_m_s,
            l.speed_max_m_s,
            60.0,
        )?;
        within("limits.climb_max_m_s", l.climb_max_m_s, 0.5, 15.0)?;
        within("limits.descent_max_m_s", l.descent_max_m_s, 0.3, 10.0)?;
        within("limits.tilt_max_deg", l.tilt_max_deg, 10.0, 60.0)
    }

    /// Electrical power of steady level flight at an airspeed and density, W; none without a battery, or where the
    /// rotors cannot hold it.
    pub fn level_power_w(&self, airspeed_m_s: f64, density_kg_m3: f64) -> Option<f64> {
        let battery = self.battery?;
        let weight_n = self.body.mass_kg * air::STANDARD_GRAVITY_M_S2;
        let body_n = 0.5 * density_kg_m3 * self.drag.area_m2[0] * airspeed_m_s * airspeed_m_s;
        let mut speed_rad_s = 0.5 * self.rotors.max_rad_s;
        let mut inflow_m_s = 0.0;
        // Rotor drag and inflow depend on the speed of the rotors and on the tilt: a few rounds suffice.
        for _ in 0..20 {
            let rotor_n = ROTORS as f64 * self.rotors.drag_n_s2_rad_m * speed_rad_s * airspeed_m_s;
            let drag_n = body_n + rotor_n;
            let each_n = weight_n.hypot(drag_n) / ROTORS as f64;
            inflow_m_s = airspeed_m_s * drag_n.atan2(weight_n).sin();
            speed_rad_s = self.rotors.speed_for(each_n, inflow_m_s, density_kg_m3);
        }
        if speed_rad_s > self.rotors.max_rad_s {
            return None;
        }
        let shaft_w = ROTORS as f64
            * speed_rad_s
            * self
                .rotors
                .torque_n_m(speed_rad_s, inflow_m_s, density_kg_m3);
        Some(battery.power_of_w(shaft_w))
    }
}

/// Least lift of all rotors at full speed over the weight that leaves room for control: 1.4, the lower end of what
/// builders of survey aircraft plan with.
const LEAST_LIFT: f64 = 1.4;
