//! What is hidden in a flight: effects of the catalogue by laws of their own, their variants whose
//! law differs a little, and effects outside it.

use super::airframe::Airframe;
use super::{FlightSpec, TrueValue};
use crate::effect_list::effects;
use crate::random::{normal, sign, stream};

effects! {
    /// An effect.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
    #[allow(missing_docs, reason = "named as the ids in docs/mechanisms.md")]
    enum FlightEffect;
    /// Effects of the catalogue that a flight without a logged wind can show.
    FLIGHT_CATALOGUE: [
        AirspeedScale = "airspeed-scale",
        ActuatorDelay = "actuator-delay",
        ActuatorLag = "actuator-lag",
        SurfaceTrimOffset = "surface-trim-offset",
        ControlEffectiveness = "control-effectiveness",
        MassChange = "mass-change",
        CgShift = "cg-shift",
        DragIncrease = "drag-increase",
        LiftSlope = "lift-slope",
        ThrustLoss = "thrust-loss",
        RollDamping = "roll-damping",
        PitchDamping = "pitch-damping",
        GyroBias = "gyro-bias",
        AccelerometerBias = "accelerometer-bias",
        AlphaVaneScale = "alpha-vane-scale",
    ]
    /// Effects outside the catalogue.
    FLIGHT_OUTSIDE: [
        /// The ailerons fade after some time.
        FadingAileron = "fading-aileron",
        /// Ice grows: drag and lost lift with time.
        Icing = "icing",
        /// The gyro for pitch wanders with time.
        GyroWander = "gyro-wander",
        /// The tail bends: the elevator loses effect with dynamic pressure.
        ElasticTail = "elastic-tail",
        /// The nose pitches up at high angle of attack.
        PitchUp = "pitch-up",
        /// The lift curve bends.
        LiftBreak = "lift-break",
    ]
}

use FlightEffect as E;

/// Which law an effect follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlightLaw {
    /// The catalogue's.
    Catalogue,
    /// One that differs a little.
    Variant,
}

impl FlightEffect {
    /// Whether the catalogue has it.
    pub fn in_catalogue(self) -> bool {
        FLIGHT_CATALOGUE.contains(&self)
    }

    /// Where an effect outside the catalogue lives.
    pub fn coordinates(self) -> &'static [&'static str] {
        match self {
            E::FadingAileron | E::Icing | E::GyroWander => &["time"],
            E::ElasticTail => &["airspeed"],
            // Angle of attack and airspeed go together in level flight.
            E::PitchUp | E::LiftBreak => &["angle_of_attack", "airspeed"],
            _ => &[],
        }
    }

    /// A strength at which it is plain, in its own unit.
    pub fn typical(self) -> f64 {
        match self {
            E::AirspeedScale => 0.05,
            E::ActuatorDelay | E::ActuatorLag => 0.03,
            E::SurfaceTrimOffset => 1.0,
            E::ControlEffectiveness => 0.12,
            E::MassChange => 0.1,
            E::CgShift => 0.01,
            E::DragIncrease => 0.006,
            E::LiftSlope | E::ThrustLoss => 0.08,
            E::RollDamping | E::PitchDamping => 0.15,
            E::GyroBias => 0.5,
            E::AccelerometerBias => 0.15,
            E::AlphaVaneScale => 0.1,
            E::FadingAileron => 0.3,
            E::Icing => 0.01,
            E::GyroWander => 0.01,
            E::ElasticTail => 0.5,
            E::PitchUp => 2.0,
            E::LiftBreak => 10.0,
        }
    }
}

/// What the hidden effects do outside the airframe's numbers.
pub struct InjectedEffects {
    /// The truth in the catalogue's words.
    pub truth: Vec<TrueValue>,
    list: Vec<(FlightEffect, f64)>,
    variant: bool,
    duration_s: f64,
    draws: [f64; 3],
    mass_kg: f64,
    /// Delay of the commands, s.
    pub delay_s: f64,
    /// First-order lag before the servo, s.
    pub lag_s: f64,
    /// Surfaces stand off what they are told, rad.
    pub trim: [f64; 3],
    /// Factor of the logged airspeed, and its part that goes with the angle of attack.
    pub airspeed: f64,
    /// Added to gyros, rad/s.
    pub gyro: [f64; 3],
    /// Added to accelerometers, m/s².
    pub accelerometer: [f64; 3],
    /// Factor and offset (rad) of the vane.
    pub vane: (f64, f64),
}

impl InjectedEffects {
    /// What `spec` hides. Small errors of workmanship are always there.
    pub fn new(spec: &FlightSpec, published: &Airframe) -> Self {
        let mut small = stream(spec.seed, "flight/workmanship");
        let mut about = |sd: f64| sd * normal(&mut small);
        let mut draw = stream(spec.seed, "flight/draws");
        let draws =
            std::array::from_fn(|_| sign(&mut draw) * (0.5 + 0.5 * normal(&mut draw).abs()));
        Self {
            truth: Vec::new(),
            list: spec.hidden.clone(),
            variant: spec.law == FlightLaw::Variant,
            duration_s: spec.duration_s,
            draws,
            mass_kg: published.n("body.mass_kg"),
            delay_s: 0.0,
            lag_s: 0.0,
            trim: [about(5e-4), about(5e-4), about(5e-4)],
            airspeed: 1.0 + about(0.002),
            gyro: [about(4e-4), about(4e-4), about(4e-4)],
            accelerometer: [about(0.006), about(0.006), about(0.006)],
            vane: (1.0 + about(0.004), about(7e-4)),
        }
    }

    fn tell(&mut self, effect: FlightEffect, name: &'static str, value: f64) {
        self.tell_whole(effect, name, value, value);
    }

    fn tell_whole(&mut self, effect: FlightEffect, name: &'static str, value: f64, whole: f64) {
        self.truth.push(TrueValue {
            mechanism: effect.id(),
            name,
            value,
            whole,
        });
    }

    /// Works the effects into the airframe.
    pub fn apply(&mut self, frame: &mut Airframe) {
        for (effect, strength) in self.list.clone() {
            let size = strength * effect.typical();
            // Direction by the seed; what can only be positive stays so.
            let s = size * self.draws[0].signum();
            match effect {
                E::ActuatorLag => self.lag(frame, size),
                E::AirspeedScale
                | E::ActuatorDelay
                | E::GyroBias
                | E::AccelerometerBias
                | E::AlphaVaneScale
                | E::SurfaceTrimOffset => self.sense_or_servo(effect, size, s),
                E::ControlEffectiveness => self.effectiveness(frame, s),
                E::MassChange | E::CgShift => self.body(frame, effect, s),
                E::DragIncrease => self.drag(frame, size),
                E::LiftSlope | E::RollDamping | E::PitchDamping => self.slopes(frame, effect, s),
                E::ThrustLoss => self.thrust(frame, s),
                E::ElasticTail => frame.hidden.elastic = size,
                E::PitchUp => frame.hidden.pitch_up = size,
                E::LiftBreak => frame.hidden.lift_break = size,
                E::FadingAileron | E::Icing | E::GyroWander => {}
            }
        }
    }

    fn body(&mut self, frame: &mut Airframe, effect: FlightEffect, s: f64) {
        if effect == E::MassChange {
            let added = s * self.mass_kg;
            frame.set("body.mass_kg", |m| m + added);
            if self.variant {
                frame.hidden.inertia_part = 0.15 * s;
            }
            self.tell(effect, "added_kg", added);
            return;
        }
        frame.set("body.cg_ahead_m", |cg| cg + s);
        if self.variant {
            frame.hidden.inertia_part = 0.5 * s.abs();
        }
        self.tell(effect, "ahead_m", s);
    }

    fn drag(&mut self, frame: &mut Airframe, size: f64) {
        frame.set("drag.zero", |d| d + size);
        if self.variant {
            frame.hidden.drag_by_alpha = 1.5 * size;
        }
        self.tell(E::DragIncrease, "cd_zero", size);
    }

    fn thrust(&mut self, frame: &mut Airframe, s: f64) {
        if self.variant {
            frame.hidden.thrust_by_throttle = s;
        }
        let plain = if self.variant { 0.5 * s } else { s };
        frame.set("propulsion.swept_area_m2", |a| a * (1.0 - plain));
        self.tell(E::ThrustLoss, "lost_share", s);
    }

    /// Lift by angle of attack, and damping; their variants bend or act on lift as well.
    fn slopes(&mut self, frame: &mut Airframe, effect: FlightEffect, s: f64) {
        let key = match effect {
            E::LiftSlope => "lift.alpha",
            E::RollDamping => "roll.p",
            _ => "pitch.q",
        };
        frame.set(key, |c| c * (1.0 + s));
        if self.variant {
            match effect {
                E::LiftSlope => frame.hidden.lift_break = -6.0 * s,
                E::RollDamping => frame.hidden.damping_growth = 3.0 * s,
                _ => frame.set("lift.q", |c| c * (1.0 + s)),
            }
        }
        self.tell(effect, "factor", 1.0 + s);
    }

    fn effectiveness(&mut self, frame: &mut Airframe, s: f64) {
        let effect = E::ControlEffectiveness;
        let [first, second, third] = self.draws.map(|d| 1.0 + s.abs() * d.clamp(-1.5, 1.5));
        frame.set("pitch.elevator", |c| c * first);
        if self.variant {
            frame.set("lift.elevator", |c| c * first);
        }
        frame.set("roll.aileron", |c| c * second);
        frame.set("yaw.aileron", |c| c * second);
        self.tell(effect, "elevator_factor", first);
        self.tell(effect, "aileron_factor", second);
        if !frame.elevons {
            frame.set("yaw.rudder", |c| c * third);
            frame.set("roll.rudder", |c| c * third);
            self.tell(effect, "rudder_factor", third);
        }
    }

    /// The servo's natural frequency falls, so that at low frequency it lags by so much more; by
    /// the variant's law a first-order lag stands before it.
    fn lag(&mut self, frame: &mut Airframe, size: f64) {
        if self.variant {
            self.lag_s = size;
        } else {
            let double = 2.0 * frame.n("surfaces.damping_ratio");
            frame.set("surfaces.natural_frequency_rad_s", |omega| {
                double / (double / omega + size)
            });
        }
        self.tell(E::ActuatorLag, "time_constant_s", size);
    }

    fn sense_or_servo(&mut self, effect: FlightEffect, size: f64, s: f64) {
        let draws = self.draws;
        match effect {
            E::AirspeedScale => {
                self.airspeed *= 1.0 + s;
                self.tell_whole(effect, "factor", 1.0 + s, self.airspeed);
            }
            E::ActuatorDelay => {
                self.delay_s = size;
                self.tell(effect, "delay_s", size);
            }
            E::SurfaceTrimOffset => {
                let names = ["elevator_deg", "aileron_deg", "rudder_deg"];
                for k in 0..3 {
                    let degrees = size * draws[k] * [0.6, 0.6, 1.0][k];
                    self.trim[k] += degrees.to_radians();
                    self.tell_whole(effect, names[k], degrees, self.trim[k].to_degrees());
                }
            }
            E::GyroBias => {
                let names = ["roll_deg_s", "pitch_deg_s", "yaw_deg_s"];
                for k in 0..3 {
                    let bias = size * draws[k];
                    self.gyro[k] += bias.to_radians();
                    self.tell_whole(effect, names[k], bias, self.gyro[k].to_degrees());
                }
            }
            E::AccelerometerBias => {
                let names = ["x_m_s2", "y_m_s2", "z_m_s2"];
                for k in 0..3 {
                    let bias = size * draws[k];
                    self.accelerometer[k] += bias;
                    self.tell_whole(effect, names[k], bias, self.accelerometer[k]);
                }
            }
            _ => {
                let offset = 8.0 * size * draws[1];
                self.vane.0 *= 1.0 + s;
                self.vane.1 += offset.to_radians();
                let (factor, radians) = self.vane;
                self.tell_whole(effect, "factor", 1.0 + s, factor);
                self.tell_whole(effect, "offset_deg", offset, radians.to_degrees());
            }
        }
    }

    fn size(&self, effect: FlightEffect) -> f64 {
        let found = self.list.iter().find(|h| h.0 == effect);
        found.map_or(0.0, |h| h.1 * effect.typical())
    }

    /// What changes with time, at `time`.
    pub fn now(&self, frame: &mut Airframe, time: f64) {
        let part = time / self.duration_s;
        let late = (2.0 * part - 0.7).clamp(0.0, 1.0);
        frame.hidden.aileron_fade = 1.0 - self.size(E::FadingAileron) * late;
        frame.hidden.ice_drag = self.size(E::Icing) * part;
    }

    /// Wander of the pitch gyro at `time`, rad/s.
    pub fn wander(&self, time: f64) -> f64 {
        self.size(E::GyroWander) * (5.0 * time / self.duration_s).sin()
    }

    /// Whether laws are variants'.
    pub fn is_variant(&self) -> bool {
        self.variant
    }
}
