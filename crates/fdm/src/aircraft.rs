//! An aircraft as a TOML file describes it: mass, geometry, aerodynamic derivatives, surfaces,
//! propulsion, limits and control gains.
//!
//! Conventions of all derivatives: per radian; rates made dimensionless by b/2V (roll, yaw) and
//! c/2V (pitch); lift, drag and side force along the wind axes; moments about the body axes
//! (forward, right, down) at the aerodynamic reference point. Surfaces are positive trailing edge
//! down (elevator, elevons), trailing edge left (rudder); the aileron angle is
//! (left − right)/2, so that positive rolls right; an elevon pair gives elevator
//! (left + right)/2 and aileron (left − right)/2.

use serde::{Deserialize, Serialize};

use crate::autopilot::ControlGains;
use crate::battery::Battery;
use crate::mechanism::{Extended, Mechanism};
use crate::scalar::larger;
use crate::{FdmError, refuse};

/// An aircraft, complete and checked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Aircraft {
    /// What people call it.
    pub name: String,
    /// Mass and inertia.
    pub body: MassProperties,
    /// Reference lengths and area.
    pub wing: Wing,
    /// Lift derivatives.
    pub lift: LiftDerivatives,
    /// Drag polar.
    pub drag: DragPolar,
    /// Side-force derivatives.
    pub side: LateralDerivatives,
    /// Rolling-moment derivatives.
    pub roll: LateralDerivatives,
    /// Pitching-moment derivatives.
    pub pitch: LiftDerivatives,
    /// Yawing-moment derivatives.
    pub yaw: LateralDerivatives,
    /// Control surfaces and their servos.
    pub surfaces: Surfaces,
    /// Motor and propeller.
    pub propulsion: Propulsion,
    /// What drives the motor; none: the flight has no end by its battery.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub battery: Option<Battery>,
    /// Where the model and the airframe hold.
    pub limits: Limits,
    /// How it leaves the ground and comes back to it.
    #[serde(default)]
    pub ground: GroundHandling,
    /// Gains of the autopilot.
    #[serde(default)]
    pub control: ControlGains,
    /// What differs between this description and the aircraft that flies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub mechanism: Vec<Mechanism>,
}

/// Mass and inertia about the centre of gravity in body axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MassProperties {
    /// Mass ready to fly, kg.
    pub mass_kg: f64,
    /// Moment of inertia about the forward axis, kg m².
    pub ixx_kg_m2: f64,
    /// Moment of inertia about the right axis, kg m².
    pub iyy_kg_m2: f64,
    /// Moment of inertia about the down axis, kg m².
    pub izz_kg_m2: f64,
    /// Product of inertia ∫xz dm, kg m²: the inertia matrix holds −Ixz off its diagonal.
    pub ixz_kg_m2: f64,
    /// How far the centre of gravity lies ahead of the aerodynamic reference point, m.
    #[serde(default)]
    pub cg_ahead_m: f64,
}

/// Reference lengths and area of the coefficients.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wing {
    /// Span b, m.
    pub span_m: f64,
    /// Mean aerodynamic chord c, m.
    pub chord_m: f64,
    /// Wing area S, m².
    pub area_m2: f64,
}

/// Derivatives of a longitudinal coefficient (lift or pitching moment).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LiftDerivatives {
    /// Value at zero angle of attack, rate and elevator.
    pub zero: f64,
    /// By angle of attack, 1/rad.
    pub alpha: f64,
    /// By dimensionless pitch rate q c/2V, 1/rad.
    pub q: f64,
    /// By elevator, 1/rad.
    pub elevator: f64,
}

/// Drag: a polynomial in the angles and, where an Oswald factor is given, induced drag
/// (CL − CL_min)²/(π e AR).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DragPolar {
    /// Parasite drag.
    pub zero: f64,
    /// By angle of attack, 1/rad.
    #[serde(default)]
    pub alpha: f64,
    /// By its square, 1/rad².
    #[serde(default)]
    pub alpha_squared: f64,
    /// By sideslip, 1/rad.
    #[serde(default)]
    pub beta: f64,
    /// By its square, 1/rad².
    #[serde(default)]
    pub beta_squared: f64,
    /// By the elevator's square, 1/rad².
    #[serde(default)]
    pub elevator_squared: f64,
    /// Oswald's span efficiency e of the induced drag; none: no such term.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub oswald: Option<f64>,
    /// Lift coefficient of least drag, for the induced term.
    #[serde(default)]
    pub min_drag_lift: f64,
}

/// Derivatives of a lateral coefficient (side force, rolling or yawing moment).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LateralDerivatives {
    /// By sideslip, 1/rad.
    pub beta: f64,
    /// By dimensionless roll rate p b/2V, 1/rad.
    pub p: f64,
    /// By dimensionless yaw rate r b/2V, 1/rad.
    pub r: f64,
    /// By aileron, 1/rad.
    pub aileron: f64,
    /// By rudder, 1/rad.
    #[serde(default)]
    pub rudder: f64,
}

/// How the commands for pitch, roll and yaw reach the surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// Two elevons, each elevator and aileron; no rudder.
    Elevons,
    /// Separate elevator, ailerons and rudder.
    Conventional,
}

/// Control surfaces and their servos: a second-order lag with limits of rate and travel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Surfaces {
    /// Elevons, or separate elevator, ailerons and rudder.
    pub layout: Layout,
    /// Travel of each surface in the negative sense, degrees (below 0).
    pub min_deg: f64,
    /// Travel of each surface in the positive sense, degrees (above 0).
    pub max_deg: f64,
    /// Fastest motion, degrees per second.
    pub rate_deg_s: f64,
    /// Natural frequency of the servo, rad/s.
    pub natural_frequency_rad_s: f64,
    /// Damping ratio of the servo.
    pub damping_ratio: f64,
    /// Pure delay between a command and the servo's first motion, s.
    #[serde(default)]
    pub delay_s: f64,
    /// Where the elevator stands when told 0, degrees.
    #[serde(default)]
    pub elevator_offset_deg: f64,
    /// Where the aileron stands when told 0, degrees.
    #[serde(default)]
    pub aileron_offset_deg: f64,
    /// Where the rudder stands when told 0, degrees.
    #[serde(default)]
    pub rudder_offset_deg: f64,
}

/// How the slipstream follows throttle δt at airspeed V.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PropellerLaw {
    /// Thrust ½ρ A Vd (Vd − V) with Vd = V + δt (V_exit − V) (Coates et al. 2019): nil at δt = 0.
    #[default]
    Blended,
    /// Thrust ½ρ A ((δt V_exit)² − V²) (Beard & McLain 2012), not below 0: the propeller gives
    /// nothing until its slipstream is faster than the flight.
    Proportional,
}

/// Motor and propeller by momentum.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Propulsion {
    /// How the slipstream follows the throttle.
    #[serde(default)]
    pub law: PropellerLaw,
    /// Effective swept area A (area times efficiency), m².
    pub swept_area_m2: f64,
    /// Speed of the slipstream at full throttle, m/s.
    pub exit_speed_m_s: f64,
    /// Time constant of the motor, s.
    pub lag_s: f64,
}

impl Propulsion {
    /// Thrust at a true airspeed, throttle (0 to 1) and air density, N.
    #[inline(always)]
    pub fn thrust_n(&self, airspeed_m_s: f64, throttle: f64, density_kg_m3: f64) -> f64 {
        let square = match self.law {
            PropellerLaw::Blended => {
                let slipstream = airspeed_m_s + throttle * (self.exit_speed_m_s - airspeed_m_s);
                slipstream * (slipstream - airspeed_m_s)
            }
            PropellerLaw::Proportional => {
                let slipstream = throttle * self.exit_speed_m_s;
                larger(slipstream * slipstream - airspeed_m_s * airspeed_m_s, 0.0)
            }
        };
        density_kg_m3 * 0.5 * square * self.swept_area_m2
    }
}

/// Where the aerodynamic model and the airframe hold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Lowest angle of attack of the linear model, degrees (below 0).
    pub alpha_min_deg: f64,
    /// Stall: highest angle of attack of the linear model, degrees.
    pub alpha_stall_deg: f64,
    /// Largest sideslip of the linear model, degrees.
    pub beta_max_deg: f64,
    /// Slowest airspeed the autopilot flies, m/s.
    pub airspeed_min_m_s: f64,
    /// Airspeed of normal cruise, m/s.
    pub airspeed_cruise_m_s: f64,
    /// Fastest airspeed the airframe allows, m/s.
    pub airspeed_max_m_s: f64,
}

/// Launch by catapult or bungee and landing on the belly.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GroundHandling {
    /// Airspeed at which the launcher lets go, m/s.
    pub launch_airspeed_m_s: f64,
    /// Acceleration along the launcher's rail, m/s².
    pub launch_acceleration_m_s2: f64,
    /// Elevation of the launcher's rail, degrees.
    pub launch_pitch_deg: f64,
    /// Coefficient of sliding friction on the ground.
    pub friction: f64,
    /// Height of the centre of gravity above the ground at rest, m.
    pub rest_height_m: f64,
    /// Sink rate at touch-down beyond which the landing counts as hard, m/s.
    pub hard_sink_m_s: f64,
}

impl Default for GroundHandling {
    fn default() -> Self {
        Self {
            launch_airspeed_m_s: 16.0,
            launch_acceleration_m_s2: 30.0,
            launch_pitch_deg: 10.0,
            friction: 0.4,
            rest_height_m: 0.1,
            hard_sink_m_s: 2.5,
        }
    }
}

impl Aircraft {
    /// Reads and checks an aircraft file. `file_name` is for messages only.
    ///
    /// # Errors
    /// [`FdmError::Syntax`] for text that is not such a file (unknown or missing key, wrong type),
    /// [`FdmError::Refused`] for a number no aircraft of this model can have, both with the line.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Self, FdmError> {
        let aircraft: Self =
            toml::from_str(text).map_err(|error| FdmError::syntax(file_name, text, &error))?;
        aircraft
            .check()
            .and_then(|()| Extended::of(&aircraft))
            .map_err(|error| error.located_in(file_name, text))?;
        Ok(aircraft)
    }

    /// The aircraft as a TOML file.
    ///
    /// # Errors
    /// [`FdmError::Unwritable`] when a value has no TOML form (none of a checked aircraft's).
    pub fn to_toml(&self) -> Result<String, FdmError> {
        toml::to_string(self).map_err(|error| FdmError::Unwritable(error.to_string()))
    }

    /// Whether this aircraft has a rudder.
    pub fn has_rudder(&self) -> bool {
        self.surfaces.layout == Layout::Conventional
    }

    /// Checks every number for sign and range.
    ///
    /// # Errors
    /// [`FdmError::Refused`] for the first number that no flyable aircraft has.
    pub fn check(&self) -> Result<(), FdmError> {
        self.check_body()?;
        self.check_longitudinal()?;
        self.check_lateral()?;
        self.check_equipment()?;
        self.check_limits()?;
        self.control.check()
    }

    fn check_body(&self) -> Result<(), FdmError> {
        let b = &self.body;
        positive("body.mass_kg", b.mass_kg)?;
        positive("body.ixx_kg_m2", b.ixx_kg_m2)?;
        positive("body.iyy_kg_m2", b.iyy_kg_m2)?;
        positive("body.izz_kg_m2", b.izz_kg_m2)?;
        let bound = (b.ixx_kg_m2 * b.izz_kg_m2).sqrt();
        if b.ixz_kg_m2.is_nan() || b.ixz_kg_m2.abs() >= bound {
            return Err(refuse(
                "body.ixz_kg_m2",
                b.ixz_kg_m2,
                format!(
                    "a magnitude below sqrt(Ixx Izz) = {bound:.4}, else the inertia matrix is not positive definite"
                ),
            ));
        }
        within("body.cg_ahead_m", b.cg_ahead_m, -1.0, 1.0)?;
        positive("wing.span_m", self.wing.span_m)?;
        positive("wing.chord_m", self.wing.chord_m)?;
        positive("wing.area_m2", self.wing.area_m2)
    }

    fn check_longitudinal(&self) -> Result<(), FdmError> {
        within("lift.zero", self.lift.zero, -2.0, 2.0)?;
        positive("lift.alpha", self.lift.alpha)?;
        within("lift.q", self.lift.q, -50.0, 50.0)?;
        within("lift.elevator", self.lift.elevator, -5.0, 5.0)?;
        positive("drag.zero", self.drag.zero)?;
        for (key, value) in [
            ("drag.alpha", self.drag.alpha),
            ("drag.alpha_squared", self.drag.alpha_squared),
            ("drag.beta", self.drag.beta),
            ("drag.beta_squared", self.drag.beta_squared),
            ("drag.elevator_squared", self.drag.elevator_squared),
            ("drag.min_drag_lift", self.drag.min_drag_lift),
        ] {
            within(key, value, -20.0, 20.0)?;
        }
        if let Some(oswald) = self.drag.oswald {
            within("drag.oswald", oswald, 0.1, 1.5)?;
        }
        within("pitch.zero", self.pitch.zero, -1.0, 1.0)?;
        negative("pitch.alpha", self.pitch.alpha, "static stability")?;
        negative("pitch.q", self.pitch.q, "pitch damping")?;
        negative(
            "pitch.elevator",
            self.pitch.elevator,
            "trailing edge down pitches the nose down",
        )
    }

    fn check_lateral(&self) -> Result<(), FdmError> {
        for (table, d) in [
            ("side", &self.side),
            ("roll", &self.roll),
            ("yaw", &self.yaw),
        ] {
            for (key, value) in [
                ("beta", d.beta),
                ("p", d.p),
                ("r", d.r),
                ("aileron", d.aileron),
                ("rudder", d.rudder),
            ] {
                within(&format!("{table}.{key}"), value, -20.0, 20.0)?;
            }
        }
        negative("roll.p", self.roll.p, "roll damping")?;
        negative("yaw.r", self.yaw.r, "yaw damping")?;
        negative("side.beta", self.side.beta, "side force against sideslip")?;
        positive("yaw.beta", self.yaw.beta)?;
        if self.roll.beta > 0.0 {
            return Err(refuse(
                "roll.beta",
                self.roll.beta,
                "0 or below (dihedral effect)",
            ));
        }
        positive("roll.aileron", self.roll.aileron)?;
        if self.has_rudder() {
            negative(
                "yaw.rudder",
                self.yaw.rudder,
                "trailing edge left yaws the nose left",
            )?;
        }
        Ok(())
    }

    fn check_equipment(&self) -> Result<(), FdmError> {
        let s = &self.surfaces;
        within("surfaces.min_deg", s.min_deg, -90.0, -1.0)?;
        within("surfaces.max_deg", s.max_deg, 1.0, 90.0)?;
        positive("surfaces.rate_deg_s", s.rate_deg_s)?;
        within(
            "surfaces.natural_frequency_rad_s",
            s.natural_frequency_rad_s,
            1.0,
            1000.0,
        )?;
        within("surfaces.damping_ratio", s.damping_ratio, 0.1, 10.0)?;
        within("surfaces.delay_s", s.delay_s, 0.0, 1.0)?;
        for (key, value) in [
            ("surfaces.elevator_offset_deg", s.elevator_offset_deg),
            ("surfaces.aileron_offset_deg", s.aileron_offset_deg),
            ("surfaces.rudder_offset_deg", s.rudder_offset_deg),
        ] {
            within(key, value, s.min_deg, s.max_deg)?;
        }
        positive("propulsion.swept_area_m2", self.propulsion.swept_area_m2)?;
        positive("propulsion.exit_speed_m_s", self.propulsion.exit_speed_m_s)?;
        within("propulsion.lag_s", self.propulsion.lag_s, 0.0, 10.0)?;
        if let Some(battery) = &self.battery {
            battery.check()?;
        }
        let g = &self.ground;
        positive("ground.launch_airspeed_m_s", g.launch_airspeed_m_s)?;
        positive(
            "ground.launch_acceleration_m_s2",
            g.launch_acceleration_m_s2,
        )?;
        within("ground.launch_pitch_deg", g.launch_pitch_deg, 0.0, 45.0)?;
        within("ground.friction", g.friction, 0.01, 2.0)?;
        within("ground.rest_height_m", g.rest_height_m, 0.0, 5.0)?;
        positive("ground.hard_sink_m_s", g.hard_sink_m_s)
    }

    fn check_limits(&self) -> Result<(), FdmError> {
        let l = &self.limits;
        within("limits.alpha_min_deg", l.alpha_min_deg, -40.0, -1.0)?;
        within("limits.alpha_stall_deg", l.alpha_stall_deg, 3.0, 40.0)?;
        within("limits.beta_max_deg", l.beta_max_deg, 3.0, 45.0)?;
        positive("limits.airspeed_min_m_s", l.airspeed_min_m_s)?;
        for (key, value, low, high) in [
            (
                "limits.airspeed_cruise_m_s",
                l.airspeed_cruise_m_s,
                l.airspeed_min_m_s,
                l.airspeed_max_m_s,
            ),
            (
                "limits.airspeed_max_m_s",
                l.airspeed_max_m_s,
                l.airspeed_min_m_s,
                300.0,
            ),
        ] {
            if !(value > low && value <= high) {
                return Err(refuse(
                    key,
                    value,
                    "airspeed_min_m_s < airspeed_cruise_m_s <= airspeed_max_m_s",
                ));
            }
        }
        if self.propulsion.exit_speed_m_s <= l.airspeed_cruise_m_s {
            return Err(refuse(
                "propulsion.exit_speed_m_s",
                self.propulsion.exit_speed_m_s,
                "more than limits.airspeed_cruise_m_s, else there is no thrust to fly with",
            ));
        }
        Ok(())
    }
}

/// Refuses what is not a finite number above zero.
pub(crate) fn positive(key: &str, value: f64) -> Result<(), FdmError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(refuse(key, value, "a number above 0"))
    }
}

/// Refuses what is not a finite number below zero.
fn negative(key: &str, value: f64, why: &str) -> Result<(), FdmError> {
    if value.is_finite() && value < 0.0 {
        Ok(())
    } else {
        Err(refuse(key, value, format!("a number below 0 ({why})")))
    }
}

/// Refuses what is not finite and inside `[low, high]`.
pub(crate) fn within(key: &str, value: f64, low: f64, high: f64) -> Result<(), FdmError> {
    if value.is_finite() && value >= low && value <= high {
        Ok(())
    } else {
        Err(refuse(key, value, format!("{low} to {high}")))
    }
}
