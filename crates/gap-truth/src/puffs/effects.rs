//! What can be hidden here, in this generator's own terms.

use super::World;
use crate::case::{HiddenEffect, TrueEffect, TrueParameter};
use crate::effect::PlumeEffect as E;
use crate::random::{sign, stream};
use rand::RngExt;
use std::f64::consts::TAU;

/// All that effects change; the default changes nothing.
#[derive(Clone, Default)]
pub(super) struct Changes {
    pub turn_deg: f64,
    pub turn_deg_per_h: f64,
    /// Amplitude of a swing of the wind that no log shows.
    pub swing_deg: f64,
    pub ln_speed: f64,
    /// Logarithms of the factors on turbulence across and up.
    pub ln_across: f64,
    pub ln_up: f64,
    pub rise_m: f64,
    pub ln_emission: f64,
    /// Growth of the emission in a straight line.
    growth_per_h: f64,
    /// Amplitude of pulses over the mean emission.
    pulse: f64,
    /// A second source: place beside the first, and part of its emission.
    second: Option<([f64; 3], f64)>,
    shift_m: [f64; 2],
    pub loss_per_s: f64,
    pub level_ppm: f64,
    level_ppm_per_h: f64,
    level_ppm_per_km: [f64; 2],
    /// Amplitude of waves of the background in time.
    level_wave_ppm: f64,
    pub sensors: Vec<SensorChanges>,
}

/// What is wrong with one sensor.
#[derive(Clone, Copy, Default)]
pub(super) struct SensorChanges {
    pub lag_s: f64,
    ln_gain: f64,
    zero_ppm: f64,
    zero_ppm_per_h: f64,
    zero_wave_ppm: f64,
    ceiling_ppm: Option<f64>,
    /// Time of the log less true time.
    pub clock_s: f64,
    /// Logged place less true place, downwind, to the right and up.
    off_m: [f64; 3],
}

/// Period of all that waves, s: several times in a record.
const PERIOD_S: f64 = 170.0;

/// A wave of amplitude 1.
pub(super) fn wave(time_s: f64) -> f64 {
    (TAU * time_s / PERIOD_S).sin()
}

/// One number of an effect: by how much a unit of strength changes it, and by how much it changes at most; its name in
/// the catalogue, none outside, and whether that is the factor of which this is the logarithm.
struct Law<T> {
    effect: E,
    unit: f64,
    most: f64,
    name: &'static str,
    field: fn(&mut T) -> &mut f64,
}

macro_rules! laws {
    ($($effect:ident $unit:literal $most:literal $name:literal $($field:ident)+ $([$k:literal])?),+ $(,)?) => {
        [$(Law {
            effect: E::$effect,
            unit: $unit,
            most: $most,
            name: $name,
            field: |c| &mut c$(.$field)+$([$k])?,
        }),+]
    };
}

const OF_WORLD: [Law<Changes>; 13] = laws![
    WindDirectionOffset 0.5 90.0 "offset_deg" turn_deg,
    WindDirectionDrift 8.0 900.0 "rate_deg_per_h" turn_deg_per_h,
    WindSpeedScale 0.1 1.0 "factor" ln_speed,
    SigmaYScale 0.07 1.3 "factor" ln_across,
    SigmaZScale 0.09 1.3 "factor" ln_up,
    EffectiveHeightOffset 2.0 150.0 "offset_m" rise_m,
    EmissionScale 0.12 1.5 "factor" ln_emission,
    EmissionTrend 1.0 7.0 "rate_per_h" growth_per_h,
    FirstOrderDecay 4e-4 0.1 "rate_per_s" loss_per_s,
    BackgroundOffset 1.0 100.0 "offset_ppm" level_ppm,
    BackgroundDrift 10.0 900.0 "rate_ppm_per_h" level_ppm_per_h,
    BackgroundWaves 1.0 100.0 "" level_wave_ppm,
    PulsingSource 0.15 1.0 "" pulse,
];

const OF_SENSOR: [Law<SensorChanges>; 7] = laws![
    SensorLag 0.6 60.0 "time_constant_s" lag_s,
    SensorGain 0.06 1.2 "factor" ln_gain,
    SensorOffset 1.0 100.0 "offset_ppm" zero_ppm,
    SensorDrift 10.0 900.0 "rate_ppm_per_h" zero_ppm_per_h,
    SensorWaves 1.2 100.0 "" zero_wave_ppm,
    ClockOffset 0.4 20.0 "offset_s" clock_s,
    AltitudeOffset 3.0 150.0 "offset_m" off_m[2],
];

/// Whether this generator has an effect.
pub fn shows(effect: E) -> bool {
    OF_WORLD.iter().any(|l| l.effect == effect)
        || OF_SENSOR.iter().any(|l| l.effect == effect)
        || matches!(
            effect,
            E::SecondSource
                | E::SourcePositionOffset
                | E::BackgroundGradient
                | E::SensorSaturation
                | E::PositionOffset
                | E::SlowSwing
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

type Named = Vec<(&'static str, f64)>;

impl<T> Law<T> {
    /// Applies a strength with its sign; a lag, a loss and amplitudes have none.
    fn put(&self, to: &mut T, strength: f64) -> Named {
        let signed =
            !matches!(self.effect, E::SensorLag | E::FirstOrderDecay) && !self.name.is_empty();
        let strength = if signed { strength } else { strength.abs() };
        let value = (self.unit * strength).clamp(-self.most, self.most);
        *(self.field)(to) = value;
        match self.name {
            "" => Vec::new(),
            "factor" => vec![("factor", value.exp())],
            name => vec![(name, value)],
        }
    }
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
        let (s, angle) = (strength * sign(&mut rng), rng.random::<f64>() * TAU);
        let count = world.tracks.len();
        let one = rng.random_bool(0.6).then(|| rng.random_range(0..count));
        let one = one.filter(|_| effect.of_a_platform() && count > 1);
        let mut parameters = Vec::new();
        if effect.of_a_platform() {
            let own = changes.sensors.iter_mut().enumerate();
            for (_, own) in own.filter(|(p, _)| one.is_none_or(|o| o == *p)) {
                parameters = of_sensor(own, world, *effect, s, angle, peak_ppm);
            }
        } else {
            parameters = of_world(&mut changes, world, *effect, s, angle);
        }
        let named = |(name, value)| TrueParameter { name, value };
        effects.push(TrueEffect {
            effect: *effect,
            platforms: one.map(|p| format!("uav{}", p + 1)).into_iter().collect(),
            parameters: parameters.into_iter().map(named).collect(),
        });
    }
    (changes, effects)
}

fn of_sensor(
    own: &mut SensorChanges,
    world: &World,
    effect: E,
    s: f64,
    angle: f64,
    peak_ppm: f64,
) -> Named {
    if let Some(law) = OF_SENSOR.iter().find(|l| l.effect == effect) {
        let mut parameters = law.put(own, s);
        if effect == E::SensorGain {
            parameters.push(("pivot_ppm", world.background_ppm));
        }
        return parameters;
    }
    if effect == E::SensorSaturation {
        let ceiling_ppm = world.background_ppm + 1.3 * peak_ppm / (1.0 + 0.3 * s.abs());
        own.ceiling_ppm = Some(ceiling_ppm);
        return vec![("limit_ppm", ceiling_ppm)];
    }
    let (sin, cos) = angle.sin_cos();
    let off_m = [6.0 * s.abs() * cos, 6.0 * s.abs() * sin];
    (own.off_m[0], own.off_m[1]) = (off_m[0], off_m[1]);
    world.east_north_of(off_m, ["east_m", "north_m"])
}

fn of_world(changes: &mut Changes, world: &World, effect: E, s: f64, angle: f64) -> Named {
    let (sin, cos) = angle.sin_cos();
    match effect {
        E::SecondSource => {
            let (width_m, _) = world.spread_m(500.0);
            let away = [
                -100.0 * (1.0 + cos),
                s.signum() * width_m * (3.0 + 1.5 * sin),
                5.0 * sin,
            ];
            let ratio = (0.1 * s.abs()).min(2.0);
            changes.second = Some((away, ratio));
            let mut parameters = world.east_north_of([away[0], away[1]], ["east_m", "north_m"]);
            parameters.push(("ratio", ratio));
            parameters
        }
        E::SourcePositionOffset => {
            changes.shift_m = [8.0 * s * cos, 8.0 * s * sin];
            world.east_north_of(changes.shift_m, ["east_m", "north_m"])
        }
        E::BackgroundGradient => {
            changes.level_ppm_per_km = [s * cos, s * sin];
            world.east_north_of(
                changes.level_ppm_per_km,
                ["east_ppm_per_km", "north_ppm_per_km"],
            )
        }
        E::SlowSwing => {
            changes.swing_deg = 0.8 * s;
            Vec::new()
        }
        _ => {
            let law = OF_WORLD.iter().find(|l| l.effect == effect);
            law.map_or_else(Vec::new, |l| l.put(changes, s))
        }
    }
}

impl World {
    fn east_north_of(&self, along_right: [f64; 2], names: [&'static str; 2]) -> Named {
        let [east, north] = self.east_north(along_right);
        vec![(names[0], east), (names[1], north)]
    }
}

impl SensorChanges {
    pub fn read_ppm(&self, air_ppm: f64, time_s: f64, clean_ppm: f64) -> f64 {
        let zero = self.zero_ppm
            + self.zero_ppm_per_h * time_s / 3600.0
            + self.zero_wave_ppm * wave(time_s);
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

    pub fn emission_factor(&self, time_s: f64) -> f64 {
        let grown = 1.0 + self.growth_per_h * time_s / 3600.0;
        (self.ln_emission.exp() * grown * (1.0 + self.pulse * wave(time_s))).max(0.0)
    }

    /// Where sensor `p` truly is at a step.
    pub fn seen_m(&self, world: &World, p: usize, k: usize) -> [f64; 3] {
        [0, 1, 2].map(|c| world.tracks[p][k][c] - self.sensors[p].off_m[c])
    }

    pub fn background_ppm(&self, world: &World, place_m: &[f64; 3], time_s: f64) -> f64 {
        let slope = |k: usize| self.level_ppm_per_km[k] * place_m[k] / 1000.0;
        let in_time = self.level_ppm_per_h * time_s / 3600.0 + self.level_wave_ppm * wave(time_s);
        let own = world.background_ppm + world.off("background.co2_ppm");
        own + self.level_ppm + in_time + slope(0) + slope(1)
    }
}
