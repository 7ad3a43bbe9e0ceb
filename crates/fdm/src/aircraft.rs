//! An aircraft as a TOML file describes it: mass, geometry, aerodynamic derivatives, surfaces,
//! propulsion, limits and control gains.
//!
//! Conventions of all derivatives: per radian; rates made dimensionless by b/2V (roll, yaw) and
//! c/2V (pitch); lift, drag and side force along the wind axes; moments about the body axes
//! (forward, right, down) at the aerodynamic reference point. Surfaces are positive trailing edge
//! down (elevator, elevons), trailing edge left (rudder); the aileron angle is
//! (left − right)/2, so that positive rolls right; an elevon pair gives elevator
//! (left + right)/2 and aileron (left − right)/2.

mod aerodynamics;
mod airframe;
mod battery;
mod control;
mod plausible;
mod propulsion;
mod servos;
mod surfaces;

pub use aerodynamics::{DragPolar, LateralDerivatives, LiftDerivatives};
pub use airframe::{GroundHandling, Limits, MassProperties, Wing};
pub use battery::{Battery, StateOfCharge};
pub use control::ControlGains;
pub use propulsion::{PropellerLaw, Propulsion};
pub(crate) use servos::OUTPUTS;
pub use servos::Servos;
pub use surfaces::{Layout, Surfaces};

use serde::{Deserialize, Serialize};

use crate::error::{FdmError, refuse};
use crate::mechanism::Mechanism;
use crate::range::{negative, positive, within};

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
    /// Outputs of an autopilot that moves them; none: those of ArduPlane's usual order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub servos: Option<Servos>,
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

impl Aircraft {
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
        self.check_sizes()?;
        self.servos.map_or(Ok(()), |servos| servos.check())?;
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
        positive("wing.area_m2", self.wing.area_m2)?;
        self.check_units()
    }

    /// Whether mass, wing and inertia go together: a number in another unit flies in no time step, or not at all.
    fn check_units(&self) -> Result<(), FdmError> {
        let (body, wing) = (&self.body, &self.wing);
        plausible::within(plausible::SPAN_M, "wing.span_m", wing.span_m, 1.0)?;
        plausible::within(
            plausible::CHORD_OF_SPAN,
            "wing.chord_m",
            wing.chord_m,
            wing.span_m,
        )?;
        plausible::within(
            plausible::AREA_OF_RECTANGLE,
            "wing.area_m2",
            wing.area_m2,
            wing.span_m * wing.chord_m,
        )?;
        plausible::within(
            plausible::WING_LOADING_KG_M2,
            "body.mass_kg",
            body.mass_kg,
            wing.area_m2,
        )?;
        let of_span = body.mass_kg * wing.span_m.powi(2);
        for (key, inertia) in [
            ("body.ixx_kg_m2", body.ixx_kg_m2),
            ("body.iyy_kg_m2", body.iyy_kg_m2),
            ("body.izz_kg_m2", body.izz_kg_m2),
        ] {
            plausible::within(plausible::INERTIA_OF_SPAN, key, inertia, of_span)?;
        }
        Ok(())
    }

    /// Whether numbers that only have a sign are of a size that aircraft have.
    fn check_sizes(&self) -> Result<(), FdmError> {
        use plausible::*;
        if let Some(battery) = &self.battery {
            let most_wh = MOST_ENERGY_WH_KG * self.body.mass_kg;
            at_most("battery.capacity_wh", battery.capacity_wh, most_wh)?;
        }
        let swept_m2 = self.propulsion.swept_area_m2;
        plausible::within(
            SWEPT_OF_WING,
            "propulsion.swept_area_m2",
            swept_m2,
            self.wing.area_m2,
        )?;
        let (pitch, ground) = (&self.pitch, &self.ground);
        for (key, value, most) in [
            ("lift.alpha", self.lift.alpha, MOST_LIFT_SLOPE),
            ("drag.zero", self.drag.zero, MOST_DRAG),
            ("drag.beta", self.drag.beta, MOST_DRAG_BY_BETA),
            ("pitch.alpha", pitch.alpha, MOST_PITCH),
            ("pitch.q", pitch.q, MOST_PITCH_DAMPING),
            ("pitch.elevator", pitch.elevator, MOST_PITCH),
            (
                "surfaces.rate_deg_s",
                self.surfaces.rate_deg_s,
                MOST_SURFACE_RATE_DEG_S,
            ),
            (
                "propulsion.exit_speed_m_s",
                self.propulsion.exit_speed_m_s,
                MOST_EXIT_SPEED_M_S,
            ),
            (
                "ground.launch_airspeed_m_s",
                ground.launch_airspeed_m_s,
                MOST_AIRSPEED_M_S,
            ),
            (
                "ground.launch_acceleration_m_s2",
                ground.launch_acceleration_m_s2,
                MOST_LAUNCH_M_S2,
            ),
            ("ground.hard_sink_m_s", ground.hard_sink_m_s, MOST_SINK_M_S),
        ] {
            at_most(key, value, most)?;
        }
        Ok(())
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
        for (table, d, most) in [
            ("side", &self.side, plausible::MOST_LATERAL),
            ("roll", &self.roll, plausible::MOST_LATERAL),
            ("yaw", &self.yaw, plausible::MOST_YAW),
        ] {
            for (key, value) in [
                ("beta", d.beta),
                ("p", d.p),
                ("r", d.r),
                ("aileron", d.aileron),
                ("rudder", d.rudder),
            ] {
                within(&format!("{table}.{key}"), value, -most, most)?;
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
                "more than limits.airspeed_cruise_m_s, else the motor gives no thrust in flight",
            ));
        }
        Ok(())
    }
}
