//! Values of a scenario that the readings of a mission contradict: slips of a digit, a unit or a sign.
//!
//! A correction starts from the scenario's priors, so a value that is far off may bend all others instead of moving. A
//! mission therefore also compares the scenario with what its readings show without any fit.

mod shown;

pub use shown::Read;

use crate::Scenario;
use crate::tables::WindFollows;
use crate::uncertain::Uncertain;
use air::geo::{Enu, Geodetic, LocalFrame, wrap_deg, wrap_signed_deg};
use air::wind::{WindProfile, WindVector};
use formats::number::{plus_minus, significant};
use plume::{DispersionModel, MechanismId};
use serde::Serialize;
use shown::{Shown, upwind};

/// A posterior that is further from its prior than this, in standard deviations of the prior, contradicts it: by chance one
/// of 16,000 is.
const CONTRADICTS_SD: f64 = 4.0;
/// An amount that is ten times what is stated contradicts it, however uncertain it is stated to be: one standard deviation of
/// its logarithm is at most this.
const LN_DIGIT_SD: f64 = std::f64::consts::LN_10 / CONTRADICTS_SD;
/// A prior's standard deviation counts at least this part of itself where a posterior is compared with it: of what readings
/// hardly tell, the difference of both is that of two large numbers.
const LEAST_PART: f64 = 0.5;
/// One standard deviation of the wind where vehicles fly about that at the plume's height, degrees and ln of the speed: what
/// veering and the law of the wind with height are off over some 100 m.
const ALOFT_SD_DEG: f64 = 10.0;
const LN_ALOFT_SD: f64 = 0.15;
/// One standard deviation of a stated wind speed, ln: that of a forecast.
const LN_WIND_SD: f64 = 0.2;
/// One standard deviation of the direction to the plume, where it was read in the mean, about the wind that vehicles report
/// meanwhile, degrees: their compass, and the meander that few crossings leave.
const PLUME_SD_DEG: f64 = 7.5;
/// A plume is read so many of its standard deviations above or below its axis.
const PLUME_REACHES: f64 = 2.0;
/// One standard deviation of a stated noise, ln: sensors differ from their data sheets by a factor below two.
const LN_NOISE_SD: f64 = 0.5;
/// One standard deviation of a noise that readings show, as a part of it.
const NOISE_SHOWN: f64 = 0.1;

/// A value with one standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Known {
    /// The value.
    pub value: f64,
    /// One standard deviation.
    pub sd: f64,
}

/// A value of the scenario that readings contradict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contradiction {
    /// Its dotted key.
    pub key: String,
    /// As the scenario has it.
    pub prior: Known,
    /// As readings show it.
    pub posterior: Known,
    /// Both in a sentence.
    pub says: String,
}

/// The model's numbers after a correction, each with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corrected {
    /// Background, ppm.
    pub background_ppm: Known,
    /// Height of the first source's axis above ground, m.
    pub effective_height_agl_m: Known,
    /// Direction towards which the axis runs, degrees.
    pub axis_deg: Known,
    /// Strength of the first source in units of the scenario's.
    pub strength: Known,
    /// Scale of σy.
    pub sigma_y_scale: Known,
    /// Scale of σz.
    pub sigma_z_scale: Known,
}

/// What a mission has shown so far, to be compared with its scenario.
#[derive(Debug, Clone)]
pub struct Evidence {
    scenario: Scenario,
    /// None where the scenario describes no world.
    world: Option<World>,
    shown: Shown,
    corrected: Option<Corrected>,
    /// What all sources emit by the mass balance of passes, kg/s.
    balance_kg_s: Option<Known>,
    named: Vec<(MechanismId, f64)>,
}

/// The scenario's world.
#[derive(Debug, Clone)]
struct World {
    frame: LocalFrame,
    wind: WindProfile,
    model: DispersionModel,
}

/// How a value is known to differ from the scenario's.
#[derive(Debug, Clone, Copy, PartialEq)]
enum By {
    /// A fit that began from the scenario's value: of a true prior, the two differ by the root of the difference of their
    /// variances.
    Fit,
    /// What knows nothing of the scenario's value.
    Readings,
}

/// A value of the scenario beside what is known of it, and how far they are apart in standard deviations.
#[derive(Debug)]
struct Comparison {
    key: String,
    prior: Known,
    posterior: Known,
    off_sd: f64,
}

impl Corrected {
    /// From values with their standard deviations in the order of the fields, of which the fourth is c_MAX; `stated_c_max_ppm`
    /// is that of the scenario.
    pub fn new(values: [(f64, f64); 6], stated_c_max_ppm: f64) -> Self {
        let known = values.map(|(value, sd)| Known { value, sd });
        let [
            background_ppm,
            effective_height_agl_m,
            axis_deg,
            c_max,
            sigma_y_scale,
            sigma_z_scale,
        ] = known;
        let strength = Known {
            value: c_max.value / stated_c_max_ppm,
            sd: c_max.sd / stated_c_max_ppm,
        };
        Self {
            background_ppm,
            effective_height_agl_m,
            axis_deg,
            strength,
            sigma_y_scale,
            sigma_z_scale,
        }
    }
}

impl Evidence {
    /// Nothing has been read yet.
    pub fn new(scenario: &Scenario) -> Self {
        let world = || {
            Some(World {
                frame: scenario.frame().ok()?,
                wind: scenario.wind_profile().ok()?,
                model: DispersionModel::new(scenario.dispersion_spec().ok()?).ok()?,
            })
        };
        Self {
            scenario: scenario.clone(),
            world: world(),
            shown: Shown::default(),
            corrected: None,
            balance_kg_s: None,
            named: Vec::new(),
        }
    }

    /// Takes a reading of a real vehicle.
    pub fn read(&mut self, read: &Read<'_>) {
        let clean = self.clean_air();
        let Some(world) = &self.world else { return };
        let height_agl_m = read.alt_amsl_m - self.scenario.site.ground_amsl_m;
        let place = (world.frame.to_enu(read.at), height_agl_m);
        self.shown.read(read, place, clean);
        let is_known = |(speed, from): &(f64, f64)| speed.is_finite() && from.is_finite();
        if let Some((speed_m_s, from_deg)) = read.wind.filter(is_known) {
            let law = |height_m: f64| world.wind.speed_at_m_s(height_m);
            let carried = law(world.wind.reference_height_agl_m()) / law(height_agl_m);
            let carried = if carried.is_finite() { carried } else { 1.0 };
            self.shown.blow(WindVector::from_speed_and_direction(
                carried * speed_m_s,
                from_deg,
            ));
        }
    }

    /// Takes the model as it was corrected last, and what the mass balance of passes makes of all sources, value
    /// and standard deviation, kg/s.
    pub fn correct(&mut self, corrected: Corrected, balance_kg_s: Option<(f64, f64)>) {
        self.corrected = Some(corrected);
        self.balance_kg_s = balance_kg_s.map(|(value, sd)| Known { value, sd });
    }

    /// Takes the mechanisms that readings have named and the model does not hold, by id and the value of their parameter.
    pub fn name<'a>(&mut self, mechanisms: impl Iterator<Item = (&'a str, f64)>) {
        self.named = mechanisms
            .filter_map(|(id, value)| Some((MechanismId::from_name(id)?, value)))
            .collect();
    }

    /// What the readings contradict, the strongest first.
    pub fn contradictions(&self) -> Vec<Contradiction> {
        let values = self.by_correction().into_iter().chain(self.by_names());
        let values = values
            .chain(self.by_balance())
            .chain(self.by_readings())
            .chain(self.by_wind())
            .chain(self.by_height())
            .filter_map(|(key, posterior, by)| self.comparison(key, posterior, by));
        let mut found: Vec<Comparison> = values
            .chain(self.by_place())
            .chain(self.by_noise())
            .filter(|c| c.off_sd > CONTRADICTS_SD)
            .collect();
        found.sort_by(|a, b| b.off_sd.total_cmp(&a.off_sd));
        let mut strongest: Vec<Comparison> = Vec::new();
        for comparison in found {
            if strongest.iter().all(|c| c.key != comparison.key) {
                strongest.push(comparison);
            }
        }
        strongest.into_iter().map(Contradiction::from).collect()
    }

    /// The scenario's value of `key` beside another.
    fn comparison(&self, key: Uncertain, posterior: Known, by: By) -> Option<Comparison> {
        let prior = self.prior(key)?;
        let relative = |known: Known| known.sd / known.value;
        let (off, prior_sd, sd) = match key {
            Uncertain::WindFrom => (
                wrap_signed_deg(posterior.value - prior.value),
                prior.sd,
                posterior.sd,
            ),
            // Amounts and scales differ by factors.
            Uncertain::WindSpeed
            | Uncertain::Emission
            | Uncertain::CMax
            | Uncertain::SigmaYScale
            | Uncertain::SigmaZScale => (
                (posterior.value / prior.value).ln(),
                relative(prior).min(LN_DIGIT_SD),
                relative(posterior),
            ),
            _ => (posterior.value - prior.value, prior.sd, posterior.sd),
        };
        let of_both = match by {
            By::Readings => prior_sd.hypot(sd),
            By::Fit => {
                let rest = prior_sd * prior_sd - sd * sd;
                rest.max((LEAST_PART * prior_sd).powi(2)).sqrt()
            }
        };
        Some(Comparison {
            key: key.key(self.scenario.gas()),
            prior,
            posterior,
            off_sd: (off / of_both).abs(),
        })
    }

    fn by_correction(&self) -> Vec<(Uncertain, Known, By)> {
        let Some(c) = &self.corrected else {
            return Vec::new();
        };
        let from_deg = Known {
            value: wrap_deg(c.axis_deg.value + 180.0),
            ..c.axis_deg
        };
        let strength = self.scaled(self.strength_key(), c.strength);
        [
            (Uncertain::Background, Some(c.background_ppm)),
            (Uncertain::EffectiveHeight, Some(c.effective_height_agl_m)),
            (Uncertain::WindFrom, self.has_one_wind().then_some(from_deg)),
            (self.strength_key(), strength),
            (Uncertain::SigmaYScale, Some(c.sigma_y_scale)),
            (Uncertain::SigmaZScale, Some(c.sigma_z_scale)),
        ]
        .into_iter()
        // Readings of clean air alone only tell where no plume was: a fit to them evades the track.
        .filter(|(key, _)| *key == Uncertain::Background || self.shown.plume().is_some())
        .filter_map(|(key, known)| Some((key, known?, By::Fit)))
        .collect()
    }

    /// What a named mechanism makes of a value, known as well as the analysis that names it asks for.
    fn by_names(&self) -> Vec<(Uncertain, Known, By)> {
        use MechanismId as M;
        let of = |&(id, value): &(MechanismId, f64)| {
            let by = Known { value, sd: 0.0 };
            let more = |key| {
                let value = self.scenario.value(key)? + value;
                Some((key, Known { value, sd: 0.0 }, By::Fit))
            };
            let times = |key| Some((key, self.scaled(key, by)?, By::Fit));
            match id {
                M::BackgroundOffset => more(Uncertain::Background),
                M::EffectiveHeightOffset => more(Uncertain::EffectiveHeight),
                M::WindDirectionOffset => more(Uncertain::WindFrom),
                M::EmissionScale => times(self.strength_key()),
                M::SigmaYScale => times(Uncertain::SigmaYScale),
                M::SigmaZScale => times(Uncertain::SigmaZScale),
                _ => None,
            }
        };
        self.named.iter().filter_map(of).collect()
    }

    /// The strength from the mass balance of passes, which uses no plume model.
    fn by_balance(&self) -> Option<(Uncertain, Known, By)> {
        let found = self.balance_kg_s.filter(|found| found.value > 0.0)?;
        let emissions = self.world.as_ref()?.model.emissions_kg_s();
        let stated_kg_s: f64 = emissions.iter().map(|(_, kg_s)| kg_s).sum();
        let value = found.value / stated_kg_s;
        // The scenario's plume is as strong as it is in the scenario's wind.
        let relative_sd = (found.sd / found.value).hypot(LN_WIND_SD);
        let by = Known {
            value,
            sd: value * relative_sd,
        };
        let key = self.strength_key();
        Some((key, self.scaled(key, by)?, By::Readings))
    }

    /// The background that readings show by themselves, where it is not the stated one.
    fn by_readings(&self) -> Option<(Uncertain, Known, By)> {
        let value = self.shown.background_ppm()?;
        let sd = self.noise_ppm();
        Some((Uncertain::Background, Known { value, sd }, By::Readings))
    }

    /// The mean of the reported winds.
    fn by_wind(&self) -> Vec<(Uncertain, Known, By)> {
        let Some(mean) = self.measured_wind() else {
            return Vec::new();
        };
        let (speed, from_deg) = (mean.speed_m_s(), mean.from_deg());
        let known = |value, sd| Known { value, sd };
        vec![
            (
                Uncertain::WindFrom,
                known(from_deg, ALOFT_SD_DEG),
                By::Readings,
            ),
            (
                Uncertain::WindSpeed,
                known(speed, LN_ALOFT_SD * speed),
                By::Readings,
            ),
        ]
    }

    /// The height at which the plume was read, as far as that tells the height of its axis.
    fn by_height(&self) -> Option<(Uncertain, Known, By)> {
        let world = self.world.as_ref()?;
        let (plume, value) = self.shown.plume()?;
        let (source, extent_m) = self.one_source(world)?;
        let away_m = source.distance_m(plume) + extent_m;
        let sd = PLUME_REACHES * world.model.sigmas_m(away_m).1;
        Some((
            Uncertain::EffectiveHeight,
            Known { value, sd },
            By::Readings,
        ))
    }

    /// The place of the source, where its plume is not read downwind of it.
    fn by_place(&self) -> Option<Comparison> {
        let world = self.world.as_ref()?;
        let (plume, _) = self.shown.plume()?;
        let (source, extent_m) = self.one_source(world)?;
        let (found, off_deg) = upwind(source, plume, self.measured_wind()?);
        let away_m = source.distance_m(plume);
        let table = &self.scenario.sources[0];
        let aside_m = extent_m + table.position_sd_m;
        let sd_deg = PLUME_SD_DEG.hypot((aside_m / away_m).atan().to_degrees());
        let at = world.frame.to_geodetic(found);
        let sd_m = away_m * sd_deg.to_radians();
        let is_north =
            (found.north_m - source.north_m).abs() > (found.east_m - source.east_m).abs();
        // Degrees that a metre is worth, by a displacement of the source.
        let aside = world
            .frame
            .to_geodetic(Enu::new(source.east_m + sd_m, source.north_m + sd_m));
        let (name, stated, value, sd) = if is_north {
            (
                "lat_deg",
                table.lat_deg,
                at.lat_deg,
                aside.lat_deg - table.lat_deg,
            )
        } else {
            (
                "lon_deg",
                table.lon_deg,
                at.lon_deg,
                aside.lon_deg - table.lon_deg,
            )
        };
        Some(Comparison {
            key: format!("source.{name}"),
            prior: Known {
                value: stated,
                sd: 0.0,
            },
            posterior: Known {
                value,
                sd: sd.abs(),
            },
            off_sd: off_deg / sd_deg,
        })
    }

    /// The noise of readings of clean air.
    fn by_noise(&self) -> Option<Comparison> {
        let shown_ppm = self.shown.noise_ppm()?;
        let sensor = self.scenario.sensor();
        let stated_ppm = self.noise_ppm();
        // Rounded readings differ by no less than they are rounded by.
        let coarse_ppm = stated_ppm.max(sensor.resolution_ppm);
        let ln_sd = sensor
            .noise_sd_ppm_known_within
            .map_or(LN_NOISE_SD, |factor| LN_NOISE_SD.max(factor.ln()));
        Some(Comparison {
            key: "sensor.noise_sd_ppm".to_owned(),
            prior: Known {
                value: stated_ppm,
                sd: ln_sd * stated_ppm,
            },
            posterior: Known {
                value: shown_ppm,
                sd: NOISE_SHOWN * shown_ppm,
            },
            off_sd: (shown_ppm / coarse_ppm).ln().abs() / ln_sd,
        })
    }

    /// The source where there is one, and half its extent, m.
    fn one_source(&self, world: &World) -> Option<(Enu, f64)> {
        let [source] = &self.scenario.sources[..] else {
            return None;
        };
        let at = Geodetic::new(source.lat_deg, source.lon_deg);
        let sides = [source.length_m, source.width_m].map(Option::unwrap_or_default);
        Some((world.frame.to_enu(at), 0.5 * sides[0].hypot(sides[1])))
    }

    /// The mean of the reported winds; none where the scenario states more than one wind.
    fn measured_wind(&self) -> Option<WindVector> {
        self.shown.wind().filter(|_| self.has_one_wind())
    }

    /// Whether the scenario states one wind for the whole mission.
    fn has_one_wind(&self) -> bool {
        let weather = &self.scenario.weather;
        weather.series.is_none() && weather.follow == WindFollows::Scenario
    }

    fn strength_key(&self) -> Uncertain {
        match self.scenario.value(Uncertain::CMax) {
            Some(_) => Uncertain::CMax,
            None => Uncertain::Emission,
        }
    }

    fn scaled(&self, key: Uncertain, by: Known) -> Option<Known> {
        let value = self.scenario.value(key)?;
        Some(Known {
            value: value * by.value,
            sd: value * by.sd,
        })
    }

    fn prior(&self, key: Uncertain) -> Option<Known> {
        let value = self.scenario.value(key)?;
        let usual = || (key == Uncertain::WindSpeed).then_some(LN_WIND_SD * value);
        Some(Known {
            value,
            sd: self.scenario.corrected_sd(key).or_else(usual)?,
        })
    }

    /// What readings of clean air are, and all that they may differ by from it.
    fn clean_air(&self) -> Known {
        let prior = self.prior(Uncertain::Background).unwrap_or(Known {
            value: f64::NAN,
            sd: f64::NAN,
        });
        let zero = self.scenario.prior_sd(Uncertain::SensorOffset);
        let sd = prior.sd.hypot(zero.unwrap_or(0.0)).hypot(self.noise_ppm());
        Known {
            value: prior.value + self.scenario.sensor().offset_ppm,
            sd: CONTRADICTS_SD * sd,
        }
    }

    fn noise_ppm(&self) -> f64 {
        self.scenario.sensor().noise_sd_ppm(self.scenario.gas())
    }
}

impl From<Comparison> for Contradiction {
    fn from(found: Comparison) -> Self {
        let Comparison {
            key,
            prior,
            posterior,
            ..
        } = found;
        let stated = match prior.sd {
            0.0 => prior.value.to_string(),
            sd => plus_minus(prior.value, sd),
        };
        let shown = match posterior.sd {
            0.0 => significant(posterior.value),
            sd => plus_minus(posterior.value, sd),
        };
        let says = format!(
            "the scenario contradicts the readings: {key} is {stated}, and they show {shown}"
        );
        Self {
            key,
            prior,
            posterior,
            says,
        }
    }
}
