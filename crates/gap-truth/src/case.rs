//! A case: what a finder gets, and what is true of it.

use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

use rand::RngExt;

use crate::effect::PlumeEffect;
use crate::further::FurtherFlight;
use crate::instrument::{
    Damage, Faults, LogRow, MeanLog, NoiseForm, NoiseLevels, Platform, SLOW_SENSORS_S,
};
use crate::physics::{Forward, Physics, TruthModel};
use crate::random::{between, pick, stream};
use crate::scene::{self, MARGIN_S, Need, Scene};
use crate::strength;
pub use crate::strength::TrueParameter;
use crate::tracks::TrackKind;
use crate::wind::{WindLaw, WindTruth};

/// One effect to hide.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HiddenEffect {
    /// The effect.
    pub effect: PlumeEffect,
    /// How strongly; 0 is not at all, 1 near the limit of the visible.
    pub strength: f64,
}

/// Kinds of damage to the raw data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum DamageKind {
    /// One sensor stands still for a while.
    Frozen,
    /// One sensor is silent for a while.
    Gap,
    /// One sensor does not read high values.
    Clipped,
    /// One platform's logged place jumps away and back.
    Jumps,
}

impl DamageKind {
    /// Its name in `gap.json`'s `data_quality`.
    pub fn as_str(self) -> &'static str {
        match self {
            DamageKind::Frozen => "frozen",
            DamageKind::Gap => "gap",
            DamageKind::Clipped => "clipped",
            DamageKind::Jumps => "outlier",
        }
    }
}

/// Who reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum TrackForm {
    /// Platforms that fly across, along and about the plume.
    Usual,
    /// Platforms that fly spirals.
    Spirals,
    /// Sensors that stand.
    Fixed,
}

/// What to make.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseSpec {
    /// Seed of scene, noise and everything else.
    pub seed: u64,
    /// Hidden effects; none for a case in which nothing is hidden.
    pub hidden: Vec<HiddenEffect>,
    /// Form of the noise.
    pub noise: NoiseForm,
    /// Forward model; `None` draws it: puffs three times in five, else a straight plume or, in a gusty
    /// wind, puffs that grow with time.
    pub forward: Option<Forward>,
    /// Whether the effects follow laws that differ a little from the catalogue's.
    pub other_laws: bool,
    /// Damage to the raw data.
    pub damage: Option<DamageKind>,
    /// From row to row of a platform, s.
    pub row_step_s: usize,
    /// Who reads.
    pub tracks: TrackForm,
}

impl CaseSpec {
    /// Nothing hidden, usual noise.
    pub fn none(seed: u64) -> Self {
        Self {
            seed,
            hidden: Vec::new(),
            noise: NoiseForm::Usual,
            forward: None,
            other_laws: false,
            damage: None,
            row_step_s: 1,
            tracks: TrackForm::Usual,
        }
    }

    /// One effect of a strength, usual noise.
    pub fn one(seed: u64, effect: PlumeEffect, strength: f64) -> Self {
        Self {
            hidden: vec![HiddenEffect { effect, strength }],
            ..Self::none(seed)
        }
    }
}

/// A hidden effect in the catalogue's words.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrueEffect {
    /// The effect.
    pub effect: PlumeEffect,
    /// Platforms that it acts on; empty for all.
    pub platforms: Vec<String>,
    /// Its parameters; none outside the catalogue.
    pub parameters: Vec<TrueParameter>,
}

/// What a finder must not see.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Truth {
    /// What is hidden.
    pub effects: Vec<TrueEffect>,
    /// Forward model.
    pub forward: Forward,
    /// Form of the noise.
    pub noise: NoiseForm,
    /// Whether the laws differ from the catalogue's.
    pub other_laws: bool,
    /// Damage: kind, platform, from and to, s.
    pub damage: Option<(DamageKind, String, f64, f64)>,
}

/// A case: files for the finder, and the truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// The scenario as TOML.
    pub scenario_toml: String,
    /// Name and text of each observation file.
    pub observations: Vec<(String, String)>,
    /// What is true.
    pub truth: Truth,
}

/// Intermittency of a plume whose axis wanders: standard deviation over the mean, and correlation
/// time, s.
const WANDERING_GUSTS: (f64, f64) = (0.3, 5.0);

/// Seconds of wind before time 0.
const HISTORY_S: f64 = 2600.0;

impl Case {
    /// The forward model that [`Case::make`] takes for `spec`.
    pub fn forward(spec: &CaseSpec) -> Forward {
        CaseBuilder::new(spec).forward
    }

    /// Makes the case of `spec`.
    pub fn make(spec: &CaseSpec) -> Self {
        let builder = CaseBuilder::new(spec);
        let control = builder.rows(&Physics::default(), &builder.no_faults());
        let (physics, faults, effects) = builder.hide(&control);
        let rows = if effects.is_empty() {
            control.clone()
        } else {
            builder.rows(&physics, &faults)
        };
        let damage = builder.damage(&control);
        Self {
            scenario_toml: builder.scene.to_toml(),
            observations: builder.files(&rows),
            truth: Truth {
                effects,
                forward: builder.forward,
                noise: spec.noise,
                other_laws: spec.other_laws,
                damage: damage.map(|(kind, index, _, from, to)| (kind, name(index), from, to)),
            },
        }
    }

    /// Observation files of the case of `spec` and of one more flight after it.
    pub fn flown_on(spec: &CaseSpec, flight: &FurtherFlight) -> Vec<(String, String)> {
        let mut builder = CaseBuilder::new(spec);
        let control = builder.rows(&Physics::default(), &builder.no_faults());
        let (physics, faults, _) = builder.hide(&control);
        let own_s = builder.scene.duration_s;
        let index = (0..builder.scene.tracks.len())
            .find(|i| name(*i) == flight.platform)
            .unwrap_or(0);
        flight.prolong(&mut builder.scene, index);
        let mut rows = builder.rows(&physics, &faults);
        for (k, rows) in rows.iter_mut().enumerate() {
            let again_s = if k == index {
                flight.start_s()
            } else {
                f64::INFINITY
            };
            rows.retain(|r| r.time_s < own_s || r.time_s >= again_s);
        }
        builder.files(&rows)
    }
}

/// (Excess, background) at every sub-step of a platform, ppm.
pub(crate) type Air = Vec<(f64, f64)>;

pub(crate) type Laws = (Physics, Vec<Faults>, Vec<TrueEffect>);

impl CaseBuilder<'_> {
    /// The laws and faults with the effects in them; `control` is without.
    fn hide(&self, control: &[Vec<LogRow>]) -> Laws {
        self.hide_each(&self.spec.hidden, control)
    }

    pub(crate) fn hide_each(&self, hidden: &[HiddenEffect], control: &[Vec<LogRow>]) -> Laws {
        let (builder, spec) = (self, self.spec);
        let mut physics = Physics {
            other_laws: spec.other_laws,
            ..Physics::default()
        };
        let mut faults = builder.no_faults();
        let mut effects = Vec::new();
        for hidden in hidden.iter().filter(|h| h.strength > 0.0) {
            let on = builder.platforms_of(hidden.effect);
            let peak_ppm = builder.peak_ppm(control, &on);
            let mut chosen: Vec<&mut Faults> = faults
                .iter_mut()
                .enumerate()
                .filter(|(i, _)| on.contains(i))
                .map(|(_, f)| f)
                .collect();
            let parameters = strength::put(
                hidden.effect,
                hidden.strength,
                &builder.scene,
                spec.seed,
                peak_ppm,
                &mut physics,
                &mut chosen,
            );
            let all = on.len() == builder.scene.tracks.len();
            let platforms = if all {
                Vec::new()
            } else {
                on.iter().map(|&i| name(i)).collect()
            };
            effects.push(TrueEffect {
                effect: hidden.effect,
                platforms,
                parameters,
            });
        }
        (physics, faults, effects)
    }
}

fn name(index: usize) -> String {
    format!("uav{}", index + 1)
}

pub(crate) struct CaseBuilder<'a> {
    pub(crate) spec: &'a CaseSpec,
    pub(crate) scene: Scene,
    pub(crate) noise: NoiseLevels,
    pub(crate) forward: Forward,
    /// The one platform of an effect that acts on one, if it does.
    single: Option<usize>,
}

impl<'a> CaseBuilder<'a> {
    pub(crate) fn new(spec: &'a CaseSpec) -> Self {
        let mut rng = stream(spec.seed, "case");
        let of_a_platform = spec.hidden.iter().any(|h| h.effect.of_a_platform());
        let outside = |h: &HiddenEffect| !h.effect.in_catalogue() && h.effect.of_a_platform();
        let (dice, which) = (rng.random_bool(0.6), rng.random::<f64>());
        let single = of_a_platform && (dice || spec.hidden.iter().any(outside));
        let puffs = rng.random_bool(0.6);
        let needs: Vec<Need> = spec.hidden.iter().map(|h| h.effect.need()).collect();
        let certain: Vec<&str> = spec
            .hidden
            .iter()
            .flat_map(|h| certain(h.effect))
            .copied()
            .collect();
        let tracks = match spec.tracks {
            TrackForm::Usual => None,
            TrackForm::Spirals => Some(TrackKind::Spiral),
            TrackForm::Fixed => Some(TrackKind::Fixed),
        };
        let least = if single { 2 } else { 1 };
        let mut scene = Scene::draw_with(spec.seed, &needs, &certain, least, tracks);
        if spec.noise == NoiseForm::SlowSensors {
            scene.lag_s = pick(&mut stream(spec.seed, "slow sensors"), &SLOW_SENSORS_S);
        }
        let turn: Option<fn(&mut Scene, u64)> = match spec.noise {
            NoiseForm::GustyWind | NoiseForm::Realistic => Some(scene::make_gusty),
            NoiseForm::UnloggedWind => Some(scene::make_unlogged),
            _ => None,
        };
        if let Some(turn) = turn {
            turn(&mut scene, spec.seed);
        }
        scene.row_step_s = spec.row_step_s.max(1);
        let mut noise = NoiseLevels::draw(spec.seed, spec.noise, scene.noise_sd_ppm);
        let wanders = |h: &HiddenEffect| h.effect == PlumeEffect::AxisWander;
        if spec.hidden.iter().any(wanders) {
            noise = noise.with_gusts(WANDERING_GUSTS);
        }
        // A straight plume does not turn with each gust.
        let drawn = match (puffs, turn.is_some()) {
            (true, _) => Forward::Puffs,
            (false, true) => Forward::AgedPuffs,
            (false, false) => Forward::Gaussian,
        };
        let single = single.then_some((which * scene.tracks.len() as f64) as usize);
        Self {
            spec,
            scene,
            noise,
            forward: spec.forward.unwrap_or(drawn),
            single,
        }
    }

    pub(crate) fn no_faults(&self) -> Vec<Faults> {
        vec![Faults::default(); self.scene.tracks.len()]
    }

    fn platforms_of(&self, effect: PlumeEffect) -> Vec<usize> {
        match self.single {
            Some(index) if effect.of_a_platform() => vec![index],
            _ => (0..self.scene.tracks.len()).collect(),
        }
    }

    fn peak_ppm(&self, control: &[Vec<LogRow>], platforms: &[usize]) -> f64 {
        let readings = platforms
            .iter()
            .flat_map(|&i| control[i].iter().filter_map(|r| r.co2_ppm));
        (readings.fold(0.0, f64::max) - self.scene.background_ppm).max(5.0)
    }

    pub(crate) fn rows(&self, physics: &Physics, faults: &[Faults]) -> Vec<Vec<LogRow>> {
        self.in_world(physics, |wind, world| {
            let nothing: Vec<Vec<LogRow>> = Vec::new();
            let damage = if self.spec.damage.is_some() {
                // Where to clip depends on the undamaged rows.
                let plain = self.logs(wind, world, faults, None);
                self.damage(&plain)
            } else {
                self.damage(&nothing)
            };
            self.logs(wind, world, faults, damage)
        })
    }

    /// The air of places `seen_off_m` from those that each platform flies, as [`Platform::air`] has it.
    pub(crate) fn airs(
        &self,
        physics: &Physics,
        seen_off_m: &[[f64; 3]],
        stride: usize,
    ) -> Vec<Air> {
        let faultless = Faults::default();
        self.in_world(physics, |wind, world| {
            (0..self.scene.tracks.len())
                .map(|index| {
                    let platform = self.platform(index, wind, world, &faultless);
                    Platform {
                        seen_off_m: seen_off_m[index],
                        ..platform
                    }
                    .air(stride)
                })
                .collect()
        })
    }

    /// What each platform would read of its air without noise.
    pub(crate) fn mean_logs(&self, airs: &[Air], faults: &[Faults]) -> Vec<MeanLog> {
        // Neither world nor wind is asked: the air is known.
        self.in_world(&Physics::default(), |wind, world| {
            let of = |(index, air): (usize, &Air)| {
                let platform = self.platform(index, wind, world, &faults[index]);
                platform.mean_log(air.clone())
            };
            airs.iter().enumerate().map(of).collect()
        })
    }

    fn in_world<T>(
        &self,
        physics: &Physics,
        ask: impl FnOnce(&WindTruth, &TruthModel<'_>) -> T,
    ) -> T {
        let seed = self.spec.seed;
        let law = WindLaw {
            unlogged_oscillation: physics.unlogged_oscillation,
            unlogged_wander: physics.unlogged_wander.or(self.noise.wander()),
            drift_deg_per_h: physics.direction_drift_deg_per_h,
            ..self.scene.wind
        };
        let until_s = self.scene.duration_s + 2.0 * MARGIN_S;
        // The log is off by what the scenario's prior allows; the transport is the wind itself.
        let mut rng = stream(seed, "wind");
        let offset = physics.direction_offset_deg;
        let wind = WindTruth::draw(&law, HISTORY_S, until_s, offset, &mut rng);
        let world = TruthModel::new(&self.scene, physics, &wind, self.forward, HISTORY_S, seed);
        ask(&wind, &world)
    }

    fn platform<'p>(
        &'p self,
        index: usize,
        wind: &'p WindTruth,
        world: &'p TruthModel<'p>,
        faults: &'p Faults,
    ) -> Platform<'p> {
        Platform {
            seed: self.spec.seed,
            index,
            scene: &self.scene,
            wind,
            world,
            noise: &self.noise,
            faults,
            damage: &[],
            seen_off_m: [0.0; 3],
        }
    }

    fn logs(
        &self,
        wind: &WindTruth,
        world: &TruthModel<'_>,
        faults: &[Faults],
        damage: Option<(DamageKind, usize, Damage, f64, f64)>,
    ) -> Vec<Vec<LogRow>> {
        let mut logs: Vec<Vec<LogRow>> = (0..self.scene.tracks.len())
            .map(|index| {
                let of_platform: Vec<Damage> = damage
                    .iter()
                    .filter(|d| d.1 == index)
                    .map(|d| d.2)
                    .collect();
                let platform = self.platform(index, wind, world, &faults[index]);
                Platform {
                    damage: &of_platform,
                    ..platform
                }
                .log()
            })
            .collect();
        if self.spec.noise == NoiseForm::Unusual {
            self.lose_rows(&mut logs);
        }
        logs
    }

    /// Short gaps and single lost rows, as of a bad link.
    fn lose_rows(&self, logs: &mut [Vec<LogRow>]) {
        let mut rng = stream(self.spec.seed, "gaps");
        for rows in logs {
            let from = between(&mut rng, 0.0, self.scene.duration_s);
            rows.retain(|r| {
                let lost = rng.random_bool(0.02);
                !(lost || (r.time_s > from && r.time_s < from + 15.0))
            });
        }
    }

    fn damage(&self, plain: &[Vec<LogRow>]) -> Option<(DamageKind, usize, Damage, f64, f64)> {
        let kind = self.spec.damage?;
        let mut rng = stream(self.spec.seed, "damage");
        let index = rng.random_range(0..self.scene.tracks.len());
        let length = match kind {
            DamageKind::Jumps => between(&mut rng, 5.0, 20.0),
            _ => between(&mut rng, 60.0, 180.0),
        };
        let from = between(&mut rng, 30.0, self.scene.duration_s - length - 30.0);
        let (from, to) = (from.round(), (from + length).round());
        let readings = || {
            plain
                .get(index)
                .into_iter()
                .flatten()
                .filter_map(|r| r.co2_ppm)
        };
        let peak = readings().fold(0.0, f64::max);
        let limit = self.scene.background_ppm + 0.35 * (peak - self.scene.background_ppm);
        Some(match kind {
            DamageKind::Frozen => (kind, index, Damage::Frozen(from, to), from, to),
            DamageKind::Gap => (kind, index, Damage::Gap(from, to), from, to),
            DamageKind::Jumps => (kind, index, Damage::Jump(from, to), from, to),
            DamageKind::Clipped => (
                kind,
                index,
                Damage::Clipped(limit.round()),
                0.0,
                self.scene.duration_s,
            ),
        })
    }

    /// The rows as CSV: all platforms in one file, or a file each.
    fn files(&self, logs: &[Vec<LogRow>]) -> Vec<(String, String)> {
        let mut rng = stream(self.spec.seed, "files");
        let apart = rng.random_bool(0.3);
        let with_sd = rng.random_bool(0.3);
        if apart {
            return (0..logs.len())
                .map(|i| {
                    (
                        format!("{}.csv", name(i)),
                        self.csv(&[(i, &logs[i])], with_sd),
                    )
                })
                .collect();
        }
        let all: Vec<(usize, &Vec<LogRow>)> = logs.iter().enumerate().collect();
        vec![("flight.csv".to_owned(), self.csv(&all, with_sd))]
    }

    fn csv(&self, logs: &[(usize, &Vec<LogRow>)], with_sd: bool) -> String {
        let mut rows: Vec<(usize, &LogRow)> = logs
            .iter()
            .flat_map(|(i, rows)| rows.iter().map(move |r| (*i, r)))
            .collect();
        rows.sort_by(|a, b| a.1.time_s.total_cmp(&b.1.time_s).then(a.0.cmp(&b.0)));
        let with_wind = rows.iter().any(|(_, r)| r.wind.is_some());
        let mut t = String::from("time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm");
        t.push_str(if with_wind {
            ",wind_speed_m_s,wind_from_deg"
        } else {
            ""
        });
        t.push_str(",temperature_c,relative_humidity_pct,pressure_hpa");
        t.push_str(if with_sd { ",sd_ppm\n" } else { "\n" });
        for (index, row) in rows {
            // Writing into a String cannot fail.
            let _ = write!(
                t,
                "{:.1},{},{:.7},{:.7},{:.2},",
                row.time_s,
                name(index),
                row.lat_lon_deg.0,
                row.lat_lon_deg.1,
                row.alt_amsl_m
            );
            if let Some(c) = row.co2_ppm {
                let _ = write!(t, "{c:.2}");
            }
            if with_wind {
                let _ = match row.wind {
                    Some((from, speed)) => write!(t, ",{speed:.2},{from:.1}"),
                    None => write!(t, ",,"),
                };
            }
            let [temperature, humidity, pressure] = row.weather;
            let _ = write!(t, ",{temperature:.2},{humidity:.1},{pressure:.2}");
            if with_sd {
                let _ = write!(t, ",{:.2}", self.noise.white_ppm());
            }
            t.push('\n');
        }
        t
    }
}

/// Keys that a scene must state without doubt for the effect to be one.
fn certain(effect: PlumeEffect) -> &'static [&'static str] {
    match effect {
        PlumeEffect::WindDirectionOffset => &["weather.wind_from_deg"],
        PlumeEffect::EmissionScale => &["emission"],
        PlumeEffect::WindSpeedScale => &["emission", "weather.wind_speed_m_s"],
        PlumeEffect::EffectiveHeightOffset => &["source.effective_height_m"],
        PlumeEffect::BackgroundOffset | PlumeEffect::SensorOffset => &["background.co2_ppm"],
        _ => &[],
    }
}
