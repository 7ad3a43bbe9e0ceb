//! A case: what a finder gets, and what is true of it.

use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

use rand::RngExt;

use crate::effect::PlumeEffect;
use crate::further::FurtherFlight;
use crate::instrument::{Damage, Faults, LogRow, NoiseForm, NoiseLevels, Platform, SLOW_SENSORS_S};
use crate::physics::{Forward, Physics, TruthModel};
use crate::random::{between, pick, stream};
use crate::scene::{self, MARGIN_S, Need, Scene};
use crate::strength::{self, TrueParameter};
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
}

impl DamageKind {
    /// Its name in `gap.json`'s `data_quality`.
    pub fn as_str(self) -> &'static str {
        match self {
            DamageKind::Frozen => "frozen",
            DamageKind::Gap => "gap",
            DamageKind::Clipped => "clipped",
        }
    }
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
#[derive(Debug, Clone, PartialEq)]
pub struct TrueEffect {
    /// The effect.
    pub effect: PlumeEffect,
    /// Platforms that it acts on; empty for all.
    pub platforms: Vec<String>,
    /// Its parameters; none outside the catalogue.
    pub parameters: Vec<TrueParameter>,
}

/// What a finder must not see.
#[derive(Debug, Clone, PartialEq)]
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
    /// The same less what the hidden effects change in the mean of each reading.
    pub control: Vec<(String, String)>,
    /// What the effect does to the plume, row by row, where that is all it does.
    pub plume_changes: Vec<TruePlumeChange>,
    /// What is true.
    pub truth: Truth,
}

/// What effects do to the plume of one row.
#[derive(Debug, Clone, PartialEq)]
pub struct TruePlumeChange {
    /// The row's platform.
    pub platform: String,
    /// Its time, s.
    pub time_s: f64,
    /// Mean plume with the effects over that without, in the same wind.
    pub factor: f64,
    /// By how much the plume is turned clockwise, degrees.
    pub turned_deg: f64,
}

/// Mean excess below which a reading is of no plume that could be multiplied, ppm.
const NO_PLUME_PPM: f64 = 1e-3;

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
            control: builder.files(&less_effects(&rows, &control)),
            plume_changes: plume_changes(&effects, &rows, &control),
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

type Laws = (Physics, Vec<Faults>, Vec<TrueEffect>);

impl CaseBuilder<'_> {
    /// The laws and faults with the effects in them; `control` is without.
    fn hide(&self, control: &[Vec<LogRow>]) -> Laws {
        let (builder, spec) = (self, self.spec);
        let mut physics = Physics {
            other_laws: spec.other_laws,
            ..Physics::default()
        };
        let mut faults = builder.no_faults();
        let mut effects = Vec::new();
        for hidden in spec.hidden.iter().filter(|h| h.strength > 0.0) {
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

/// `rows` less the differences of their mean readings to those of `control`: rounded anew and with
/// gusts, the difference of two files would be mostly noise.
fn less_effects(rows: &[Vec<LogRow>], control: &[Vec<LogRow>]) -> Vec<Vec<LogRow>> {
    let less = |(row, control): (&LogRow, &LogRow)| LogRow {
        co2_ppm: row.co2_ppm.map(|c| c - (row.mean_ppm - control.mean_ppm)),
        ..*control
    };
    rows.iter()
        .zip(control)
        .map(|(rows, control)| rows.iter().zip(control).map(less).collect())
        .collect()
}

/// What `effects` do to the plume of each row; nothing where they do anything else.
fn plume_changes(
    effects: &[TrueEffect],
    rows: &[Vec<LogRow>],
    control: &[Vec<LogRow>],
) -> Vec<TruePlumeChange> {
    let [TrueEffect { effect, .. }] = effects else {
        return Vec::new();
    };
    let (multiplies, turns) = (effect.multiplies_the_plume(), effect.turns_the_plume());
    if !(multiplies || turns) {
        return Vec::new();
    }
    let mut out = Vec::new();
    for (index, (rows, control)) in rows.iter().zip(control).enumerate() {
        for (row, control) in rows.iter().zip(control) {
            let counts = multiplies && control.mean_excess_ppm > NO_PLUME_PPM;
            out.push(TruePlumeChange {
                platform: name(index),
                time_s: row.time_s,
                factor: if counts {
                    row.mean_excess_ppm / control.mean_excess_ppm
                } else {
                    1.0
                },
                turned_deg: if turns { row.unlogged_turn_deg } else { 0.0 },
            });
        }
    }
    out
}

fn name(index: usize) -> String {
    format!("uav{}", index + 1)
}

struct CaseBuilder<'a> {
    spec: &'a CaseSpec,
    scene: Scene,
    noise: NoiseLevels,
    forward: Forward,
    /// The one platform of an effect that acts on one, if it does.
    single: Option<usize>,
}

impl<'a> CaseBuilder<'a> {
    fn new(spec: &'a CaseSpec) -> Self {
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
        let mut scene = Scene::draw(spec.seed, &needs, &certain, if single { 2 } else { 1 });
        if spec.noise == NoiseForm::SlowSensors {
            scene.lag_s = pick(&mut stream(spec.seed, "slow sensors"), &SLOW_SENSORS_S);
        }
        let turn: Option<fn(&mut Scene, u64)> = match spec.noise {
            NoiseForm::GustyWind => Some(scene::make_gusty),
            NoiseForm::UnloggedWind => Some(scene::make_unlogged),
            _ => None,
        };
        if let Some(turn) = turn {
            turn(&mut scene, spec.seed);
        }
        let noise = NoiseLevels::draw(spec.seed, spec.noise, scene.noise_sd_ppm);
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

    fn no_faults(&self) -> Vec<Faults> {
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

    fn rows(&self, physics: &Physics, faults: &[Faults]) -> Vec<Vec<LogRow>> {
        let seed = self.spec.seed;
        let law = WindLaw {
            unlogged_oscillation: physics.unlogged_oscillation,
            drift_deg_per_h: physics.direction_drift_deg_per_h,
            ..self.scene.wind
        };
        let until_s = self.scene.duration_s + 2.0 * MARGIN_S;
        // The log is off by what the scenario's prior allows; the transport is the wind itself.
        let mut rng = stream(seed, "wind");
        let offset = physics.direction_offset_deg;
        let wind = WindTruth::draw(&law, HISTORY_S, until_s, offset, &mut rng);
        let world = TruthModel::new(&self.scene, physics, &wind, self.forward, HISTORY_S, seed);
        let nothing: Vec<Vec<LogRow>> = Vec::new();
        let damage = if self.spec.damage.is_some() {
            // Where to clip depends on the undamaged rows.
            let plain = self.logs(&wind, &world, faults, None);
            self.damage(&plain)
        } else {
            self.damage(&nothing)
        };
        self.logs(&wind, &world, faults, damage)
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
                let platform = Platform {
                    seed: self.spec.seed,
                    index,
                    scene: &self.scene,
                    wind,
                    world,
                    noise: &self.noise,
                    faults: &faults[index],
                    damage: &of_platform,
                };
                platform.log()
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
        let length = between(&mut rng, 60.0, 180.0);
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
