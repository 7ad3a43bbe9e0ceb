//! A case: what a finder gets, and what is true of it.

use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

use rand::RngExt;

use crate::chance::{between, pick, stream};
use crate::effect::Effect;
use crate::further::FurtherFlight;
use crate::instrument::{Damage, Faults, Noise, NoiseForm, Platform, Row, SLOW_SENSORS_S};
use crate::physics::{Forward, Physics, World};
use crate::scene::{self, MARGIN_S, Need, Scene};
use crate::strength::{self, Parameter};
use crate::wind::{WindLaw, WindTruth};

/// One effect to hide.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hidden {
    /// The effect.
    pub effect: Effect,
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
    pub hidden: Vec<Hidden>,
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
    pub fn one(seed: u64, effect: Effect, strength: f64) -> Self {
        Self {
            hidden: vec![Hidden { effect, strength }],
            ..Self::none(seed)
        }
    }
}

/// A hidden effect in the catalogue's words.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueEffect {
    /// The effect.
    pub effect: Effect,
    /// Platforms that it acts on; empty for all.
    pub platforms: Vec<String>,
    /// Its parameters; none outside the catalogue.
    pub parameters: Vec<Parameter>,
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
    pub twin: Vec<(String, String)>,
    /// What the effect does to the plume, row by row, where that is all it does.
    pub plume_changes: Vec<PlumeChange>,
    /// What is true.
    pub truth: Truth,
}

/// What effects do to the plume of one row.
#[derive(Debug, Clone, PartialEq)]
pub struct PlumeChange {
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
        Draft::new(spec).forward
    }

    /// Makes the case of `spec`.
    pub fn make(spec: &CaseSpec) -> Self {
        let draft = Draft::new(spec);
        let twin = draft.rows(&Physics::default(), &draft.no_faults());
        let (physics, faults, effects) = draft.hide(&twin);
        let rows = if effects.is_empty() {
            twin.clone()
        } else {
            draft.rows(&physics, &faults)
        };
        let damage = draft.damage(&twin);
        Self {
            scenario_toml: draft.scene.to_toml(),
            observations: draft.files(&rows),
            twin: draft.files(&less_effects(&rows, &twin)),
            plume_changes: plume_changes(&effects, &rows, &twin),
            truth: Truth {
                effects,
                forward: draft.forward,
                noise: spec.noise,
                other_laws: spec.other_laws,
                damage: damage.map(|(kind, index, _, from, to)| (kind, name(index), from, to)),
            },
        }
    }

    /// Observation files of the case of `spec` and of one more flight after it.
    pub fn flown_on(spec: &CaseSpec, flight: &FurtherFlight) -> Vec<(String, String)> {
        let mut draft = Draft::new(spec);
        let twin = draft.rows(&Physics::default(), &draft.no_faults());
        let (physics, faults, _) = draft.hide(&twin);
        let own_s = draft.scene.duration_s;
        let index = (0..draft.scene.tracks.len())
            .find(|i| name(*i) == flight.platform)
            .unwrap_or(0);
        flight.prolong(&mut draft.scene, index);
        let mut rows = draft.rows(&physics, &faults);
        for (k, rows) in rows.iter_mut().enumerate() {
            let again_s = if k == index {
                flight.start_s()
            } else {
                f64::INFINITY
            };
            rows.retain(|r| r.time_s < own_s || r.time_s >= again_s);
        }
        draft.files(&rows)
    }
}

type Laws = (Physics, Vec<Faults>, Vec<TrueEffect>);

impl Draft<'_> {
    /// The laws and faults with the effects in them; `twin` is without.
    fn hide(&self, twin: &[Vec<Row>]) -> Laws {
        let (draft, spec) = (self, self.spec);
        let mut physics = Physics {
            other_laws: spec.other_laws,
            ..Physics::default()
        };
        let mut faults = draft.no_faults();
        let mut effects = Vec::new();
        for hidden in spec.hidden.iter().filter(|h| h.strength > 0.0) {
            let on = draft.platforms_of(hidden.effect);
            let peak_ppm = draft.peak_ppm(twin, &on);
            let mut chosen: Vec<&mut Faults> = faults
                .iter_mut()
                .enumerate()
                .filter(|(i, _)| on.contains(i))
                .map(|(_, f)| f)
                .collect();
            let parameters = strength::put(
                hidden.effect,
                hidden.strength,
                &draft.scene,
                spec.seed,
                peak_ppm,
                &mut physics,
                &mut chosen,
            );
            let all = on.len() == draft.scene.tracks.len();
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

/// `rows` less the differences of their mean readings to those of `twin`: rounded anew and with
/// gusts, the difference of two files would be mostly noise.
fn less_effects(rows: &[Vec<Row>], twin: &[Vec<Row>]) -> Vec<Vec<Row>> {
    let less = |(row, twin): (&Row, &Row)| Row {
        co2_ppm: row.co2_ppm.map(|c| c - (row.mean_ppm - twin.mean_ppm)),
        ..*twin
    };
    rows.iter()
        .zip(twin)
        .map(|(rows, twin)| rows.iter().zip(twin).map(less).collect())
        .collect()
}

/// What `effects` do to the plume of each row; nothing where they do anything else.
fn plume_changes(effects: &[TrueEffect], rows: &[Vec<Row>], twin: &[Vec<Row>]) -> Vec<PlumeChange> {
    let [TrueEffect { effect, .. }] = effects else {
        return Vec::new();
    };
    let (multiplies, turns) = (effect.multiplies_the_plume(), effect.turns_the_plume());
    if !(multiplies || turns) {
        return Vec::new();
    }
    let mut out = Vec::new();
    for (index, (rows, twin)) in rows.iter().zip(twin).enumerate() {
        for (row, twin) in rows.iter().zip(twin) {
            let counts = multiplies && twin.mean_excess_ppm > NO_PLUME_PPM;
            out.push(PlumeChange {
                platform: name(index),
                time_s: row.time_s,
                factor: if counts {
                    row.mean_excess_ppm / twin.mean_excess_ppm
                } else {
                    1.0
                },
                turned_deg: if turns { row.swung_deg } else { 0.0 },
            });
        }
    }
    out
}

fn name(index: usize) -> String {
    format!("uav{}", index + 1)
}

struct Draft<'a> {
    spec: &'a CaseSpec,
    scene: Scene,
    noise: Noise,
    forward: Forward,
    /// The one platform of an effect that acts on one, if it does.
    single: Option<usize>,
}

impl<'a> Draft<'a> {
    fn new(spec: &'a CaseSpec) -> Self {
        let mut rng = stream(spec.seed, "case");
        let of_a_platform = spec.hidden.iter().any(|h| h.effect.of_a_platform());
        let outside = |h: &Hidden| !h.effect.in_catalogue() && h.effect.of_a_platform();
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
        let noise = Noise::draw(spec.seed, spec.noise, scene.noise_sd_ppm);
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

    fn platforms_of(&self, effect: Effect) -> Vec<usize> {
        match self.single {
            Some(index) if effect.of_a_platform() => vec![index],
            _ => (0..self.scene.tracks.len()).collect(),
        }
    }

    fn peak_ppm(&self, twin: &[Vec<Row>], platforms: &[usize]) -> f64 {
        let readings = platforms
            .iter()
            .flat_map(|&i| twin[i].iter().filter_map(|r| r.co2_ppm));
        (readings.fold(0.0, f64::max) - self.scene.background_ppm).max(5.0)
    }

    fn rows(&self, physics: &Physics, faults: &[Faults]) -> Vec<Vec<Row>> {
        let seed = self.spec.seed;
        let law = WindLaw {
            hidden_swing: physics.hidden_swing,
            drift_deg_per_h: physics.direction_drift_deg_per_h,
            ..self.scene.wind
        };
        let until_s = self.scene.duration_s + 2.0 * MARGIN_S;
        // The log is off by what the scenario's prior allows; the transport is the wind itself.
        let mut rng = stream(seed, "wind");
        let offset = physics.direction_offset_deg;
        let wind = WindTruth::draw(&law, HISTORY_S, until_s, offset, &mut rng);
        let world = World::new(&self.scene, physics, &wind, self.forward, HISTORY_S, seed);
        let nothing: Vec<Vec<Row>> = Vec::new();
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
        world: &World<'_>,
        faults: &[Faults],
        damage: Option<(DamageKind, usize, Damage, f64, f64)>,
    ) -> Vec<Vec<Row>> {
        let mut logs: Vec<Vec<Row>> = (0..self.scene.tracks.len())
            .map(|index| {
                let harm: Vec<Damage> = damage
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
                    damage: &harm,
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
    fn lose_rows(&self, logs: &mut [Vec<Row>]) {
        let mut rng = stream(self.spec.seed, "gaps");
        for rows in logs {
            let from = between(&mut rng, 0.0, self.scene.duration_s);
            rows.retain(|r| {
                let lost = rng.random_bool(0.02);
                !(lost || (r.time_s > from && r.time_s < from + 15.0))
            });
        }
    }

    fn damage(&self, plain: &[Vec<Row>]) -> Option<(DamageKind, usize, Damage, f64, f64)> {
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
    fn files(&self, logs: &[Vec<Row>]) -> Vec<(String, String)> {
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
        let all: Vec<(usize, &Vec<Row>)> = logs.iter().enumerate().collect();
        vec![("flight.csv".to_owned(), self.csv(&all, with_sd))]
    }

    fn csv(&self, logs: &[(usize, &Vec<Row>)], with_sd: bool) -> String {
        let mut rows: Vec<(usize, &Row)> = logs
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
fn certain(effect: Effect) -> &'static [&'static str] {
    match effect {
        Effect::WindDirectionOffset => &["weather.wind_from_deg"],
        Effect::EmissionScale => &["emission"],
        Effect::WindSpeedScale => &["emission", "weather.wind_speed_m_s"],
        Effect::EffectiveHeightOffset => &["source.effective_height_m"],
        Effect::BackgroundOffset | Effect::SensorOffset => &["background.co2_ppm"],
        _ => &[],
    }
}
