//! What can be hidden here, in this generator's own terms.

use super::World;
use crate::case::{HiddenEffect, TrueEffect, TrueParameter};
use crate::effect::PlumeEffect as E;
use crate::random::{sign, stream};
use rand::RngExt;
use rand::rngs::ChaCha8Rng;
use std::f64::consts::TAU;

/// All that effects change; the default changes nothing.
#[derive(Clone, Default)]
pub(super) struct Changes {
    pub turn_deg: f64,
    pub turn_deg_per_h: f64,
    pub ln_speed: f64,
    /// Logarithms of the factors on turbulence across and up.
    pub ln_across: f64,
    pub ln_up: f64,
    pub rise_m: f64,
    /// Logarithm of the emission's factor, and its growth in a straight line, 1/h.
    pub ln_emission: f64,
    pub growth_per_h: f64,
    /// Part of the emission that pulses, and the period, s.
    pulse: Option<(f64, f64)>,
    /// Part of the emission that is on and off, and the mean length of a turn, s.
    on_off: Option<(f64, f64)>,
    /// A swing of the wind that no log shows: amplitude, degrees, and period, s.
    swing: Option<(f64, f64)>,
    second: Option<([f64; 3], f64)>,
    shift_m: [f64; 2],
    pub loss_per_s: f64,
    pub level_ppm: f64,
    level_ppm_per_h: f64,
    level_ppm_per_km: [f64; 2],
    waves: Option<(f64, f64)>,
    layer: Option<(f64, f64, f64)>,
    pub sensors: Vec<SensorChanges>,
}

/// What is wrong with one sensor.
#[derive(Clone, Copy, Default)]
pub(super) struct SensorChanges {
    pub lag_s: f64,
    ln_gain: f64,
    zero_ppm: f64,
    zero_ppm_per_h: f64,
    ceiling_ppm: Option<f64>,
    waves: Option<(f64, f64)>,
    /// Time of the log less true time, s.
    pub clock_s: f64,
    /// Logged place less true place, m downwind, to the right and up.
    off_m: [f64; 3],
}

impl SensorChanges {
    pub fn read_ppm(&self, air_ppm: f64, time_s: f64, clean_ppm: f64) -> f64 {
        let waves = self
            .waves
            .map_or(0.0, |(a, s)| a * (TAU * time_s / s).sin());
        let zero = self.zero_ppm + self.zero_ppm_per_h * time_s / 3600.0 + waves;
        let read = clean_ppm + (air_ppm - clean_ppm) * self.ln_gain.exp() + zero;
        read.min(self.ceiling_ppm.unwrap_or(f64::INFINITY))
    }
}

impl Changes {
    pub fn none(world: &World) -> Self {
        Self {
            sensors: vec![SensorChanges::default(); world.tracks.len()],
            ..Self::default()
        }
    }

    /// Where puffs begin, and the part of the emission that begins there.
    pub fn sources(&self, axis_m: f64) -> Vec<([f64; 3], f64)> {
        let [x, y] = self.shift_m;
        let first = ([x, y, axis_m + self.rise_m], 1.0);
        let second = self
            .second
            .map(|([x, y, up], part)| ([x, y, axis_m + up], part));
        std::iter::once(first).chain(second).collect()
    }

    pub fn emission_factor(&self, time_s: f64, on_off: f64) -> f64 {
        let pulse = self
            .pulse
            .map_or(0.0, |(a, s)| a * (TAU * time_s / s).sin());
        let turn = self.on_off.map_or(0.0, |(a, _)| a * on_off);
        self.ln_emission.exp() * (1.0 + self.growth_per_h * time_s / 3600.0) * (1.0 + pulse + turn)
    }

    /// -1 where an emission that is on and off changes in this step, else 1.
    pub fn flips(&self, rng: &mut ChaCha8Rng) -> f64 {
        let dice: f64 = rng.random();
        let changes = self.on_off.is_some_and(|(_, s)| dice < super::STEP_S / s);
        if changes { -1.0 } else { 1.0 }
    }

    /// Where sensor `p` truly is at a step.
    pub fn seen_m(&self, world: &World, p: usize, k: usize) -> [f64; 3] {
        [0, 1, 2].map(|c| world.tracks[p][k][c] - self.sensors[p].off_m[c])
    }

    pub fn swing_deg(&self, time_s: f64) -> f64 {
        self.swing
            .map_or(0.0, |(a, s)| a * (TAU * time_s / s).sin())
    }

    pub fn background_ppm(&self, world: &World, place_m: &[f64; 3], time_s: f64) -> f64 {
        let waves = self
            .waves
            .map_or(0.0, |(a, s)| a * (TAU * time_s / s).sin());
        let layer = self.layer.map_or(0.0, |(a, middle_m, half_m)| {
            a * (-0.5 * ((place_m[2] - middle_m) / half_m).powi(2)).exp()
        });
        let slope: f64 = (0..2)
            .map(|k| self.level_ppm_per_km[k] * place_m[k] / 1000.0)
            .sum();
        world.background_ppm
            + world.off("background.co2_ppm")
            + self.level_ppm
            + self.level_ppm_per_h * time_s / 3600.0
            + slope
            + waves
            + layer
    }
}

/// Whether this generator has an effect.
pub fn shows(effect: E) -> bool {
    use E as P;
    effect.in_catalogue()
        && !matches!(
            effect,
            P::WindVeerWithHeight
                | P::Meander
                | P::StabilityClass
                | P::SigmaZGrowth
                | P::GroundReflection
                | P::MixingLid
                | P::DryDeposition
                | P::BuildingDownwash
                | P::CrossSensitivityHumidity
                | P::CrossSensitivityTemperature
                | P::CrossSensitivityPressure
        )
        || matches!(
            effect,
            P::SlowSwing
                | P::BackgroundWaves
                | P::BackgroundLayer
                | P::PulsingSource
                | P::SensorWaves
                | P::OnOffEmission
        )
}

/// Keys that a scenario must state without doubt where these are hidden.
pub(super) fn certain(hidden: &[HiddenEffect]) -> Vec<&'static str> {
    let of = |h: &HiddenEffect| match h.effect {
        E::WindDirectionOffset => Some("weather.wind_from_deg"),
        E::EmissionScale | E::WindSpeedScale => Some("source.emission_kg_s"),
        E::EffectiveHeightOffset => Some("source.effective_height_m"),
        E::BackgroundOffset | E::SensorOffset => Some("background.co2_ppm"),
        _ => None,
    };
    hidden.iter().filter_map(of).collect()
}

/// The changes that hidden effects make, and what is true of them. `peak_ppm` is the highest excess that is met.
pub(super) fn hide(
    world: &World,
    hidden: &[HiddenEffect],
    peak_ppm: f64,
) -> (Changes, Vec<TrueEffect>) {
    let mut changes = Changes::none(world);
    let mut effects = Vec::new();
    for HiddenEffect { effect, strength } in hidden.iter().filter(|h| h.strength > 0.0) {
        let mut rng = stream(world.seed, &format!("puffs/{effect}"));
        let (sign, angle, part) = (
            sign(&mut rng),
            rng.random::<f64>() * TAU,
            rng.random::<f64>(),
        );
        let s = strength * sign;
        let count = world.tracks.len();
        let one = rng.random_bool(0.6).then(|| rng.random_range(0..count));
        let one = one.filter(|_| effect.of_a_platform() && count > 1);
        let parameters = if effect.of_a_platform() {
            let mut parameters = Vec::new();
            for (_, own) in changes
                .sensors
                .iter_mut()
                .enumerate()
                .filter(|(p, _)| one.is_none_or(|o| o == *p))
            {
                parameters = of_sensor(own, world, *effect, s, angle, peak_ppm);
            }
            parameters
        } else {
            of_world(&mut changes, world, *effect, s, angle, part)
        };
        effects.push(TrueEffect {
            effect: *effect,
            platforms: one.map(|p| format!("uav{}", p + 1)).into_iter().collect(),
            parameters: parameters
                .into_iter()
                .map(|(name, value)| TrueParameter { name, value })
                .collect(),
        });
    }
    (changes, effects)
}

type Named = Vec<(&'static str, f64)>;

fn of_sensor(
    own: &mut SensorChanges,
    world: &World,
    effect: E,
    s: f64,
    angle: f64,
    peak_ppm: f64,
) -> Named {
    let (size, clean_ppm) = (s.abs(), world.background_ppm);
    match effect {
        E::SensorLag => own.lag_s = 0.6 * size,
        E::SensorGain => {
            own.ln_gain = (0.06 * s).clamp(-1.2, 1.2);
            return vec![("factor", own.ln_gain.exp()), ("pivot_ppm", clean_ppm)];
        }
        E::SensorOffset => own.zero_ppm = s,
        E::SensorDrift => own.zero_ppm_per_h = 10.0 * s,
        E::SensorSaturation => {
            own.ceiling_ppm = Some(clean_ppm + 1.3 * peak_ppm / (1.0 + 0.3 * size))
        }
        E::ClockOffset => own.clock_s = (0.4 * s).clamp(-20.0, 20.0),
        E::AltitudeOffset => own.off_m[2] = 3.0 * s,
        E::PositionOffset => {
            (own.off_m[0], own.off_m[1]) = (6.0 * size * angle.sin(), 6.0 * size * angle.cos());
            let [east, north] = world.east_north([own.off_m[0], own.off_m[1]]);
            return vec![("east_m", east), ("north_m", north)];
        }
        _ => {
            own.waves = Some((1.2 * size, 170.0));
            return Vec::new();
        }
    }
    vec![match effect {
        E::SensorLag => ("time_constant_s", own.lag_s),
        E::SensorOffset => ("offset_ppm", own.zero_ppm),
        E::SensorDrift => ("rate_ppm_per_h", own.zero_ppm_per_h),
        E::SensorSaturation => ("limit_ppm", own.ceiling_ppm.unwrap_or(0.0)),
        E::ClockOffset => ("offset_s", own.clock_s),
        _ => ("offset_m", own.off_m[2]),
    }]
}

fn of_world(c: &mut Changes, world: &World, effect: E, s: f64, angle: f64, part: f64) -> Named {
    let size = s.abs();
    match effect {
        E::WindDirectionOffset => c.turn_deg = 0.5 * s,
        E::WindDirectionDrift => c.turn_deg_per_h = 8.0 * s,
        E::WindSpeedScale => c.ln_speed = (0.1 * s).clamp(-1.0, 1.0),
        E::SigmaYScale => c.ln_across = (0.07 * s).clamp(-1.3, 1.3),
        E::SigmaZScale => c.ln_up = (0.09 * s).clamp(-1.3, 1.3),
        E::EffectiveHeightOffset => {
            c.rise_m = (0.02 * world.axis_m * s + s).max(-0.8 * world.axis_m)
        }
        E::EmissionScale => c.ln_emission = (0.12 * s).clamp(-1.5, 1.5),
        E::EmissionTrend => c.growth_per_h = s.clamp(-5.0, 15.0),
        E::SecondSource => {
            let x = -200.0 * part;
            let (width_m, _) = world.spread_m(500.0 - x);
            let away = [
                x,
                s.signum() * width_m * (1.5 + 3.0 * part),
                5.0 * angle.sin(),
            ];
            let ratio = (0.1 * size).min(2.0);
            c.second = Some((away, ratio));
            let [east, north] = world.east_north([away[0], away[1]]);
            return vec![("east_m", east), ("north_m", north), ("ratio", ratio)];
        }
        E::SourcePositionOffset => {
            c.shift_m = [8.0 * size * angle.cos(), 8.0 * size * angle.sin()];
            let [east, north] = world.east_north(c.shift_m);
            return vec![("east_m", east), ("north_m", north)];
        }
        E::FirstOrderDecay => c.loss_per_s = 4e-4 * size,
        E::BackgroundOffset => c.level_ppm = s,
        E::BackgroundDrift => c.level_ppm_per_h = 10.0 * s,
        E::BackgroundGradient => {
            c.level_ppm_per_km = [size * angle.cos(), size * angle.sin()];
            let [east, north] = world.east_north(c.level_ppm_per_km);
            return vec![("east_ppm_per_km", east), ("north_ppm_per_km", north)];
        }
        E::SlowSwing => c.swing = Some((0.8 * size, 250.0)),
        E::BackgroundWaves => c.waves = Some((size, 170.0)),
        E::BackgroundLayer => {
            c.layer = Some((
                1.5 * s,
                world.axis_m * (0.7 + 0.6 * part),
                0.15 * world.axis_m + 5.0,
            ))
        }
        E::OnOffEmission => c.on_off = Some(((0.15 * size).min(1.0), 40.0 + 60.0 * part)),
        _ => c.pulse = Some(((0.15 * size).min(1.0), 150.0)),
    }
    if !effect.in_catalogue() {
        return Vec::new();
    }
    vec![match effect {
        E::WindDirectionOffset => ("offset_deg", c.turn_deg),
        E::WindDirectionDrift => ("rate_deg_per_h", c.turn_deg_per_h),
        E::WindSpeedScale => ("factor", c.ln_speed.exp()),
        E::SigmaYScale => ("factor", c.ln_across.exp()),
        E::SigmaZScale => ("factor", c.ln_up.exp()),
        E::EffectiveHeightOffset => ("offset_m", c.rise_m),
        E::EmissionScale => ("factor", c.ln_emission.exp()),
        E::EmissionTrend => ("rate_per_h", c.growth_per_h),
        E::FirstOrderDecay => ("rate_per_s", c.loss_per_s),
        E::BackgroundOffset => ("offset_ppm", c.level_ppm),
        _ => ("rate_ppm_per_h", c.level_ppm_per_h),
    }]
}
