//! Readings along the ways of platforms that move, and the wind that blew meanwhile.

use crate::{LOGGED_SPEED_LN_SD, SCENARIO_SPEED_LN_SD};
use air::geo::LocalFrame;
use air::wind::WindVector;
use plume::DispersionSpec;
use plume::curtain::{Sample, Site};
use scenario::Scenario;
use scenario::observations::{ObservationRow, Observations};

/// A wind is carried to heights that differ from its own by this factor at most: beyond, no power law holds, and a vehicle on
/// the ground meets no wind of the plume.
const SAME_LAYER: f64 = 2.0;

/// Heights are known to about this, m.
const LEAST_HEIGHT_M: f64 = 1.0;

/// Whether heights with this ratio are so near each other that a wind is carried from one to the other.
pub fn is_same_layer(ratio: f64) -> bool {
    (1.0 / SAME_LAYER..=SAME_LAYER).contains(&ratio)
}

/// The site of the first source.
pub fn site(spec: &DispersionSpec) -> Site {
    Site {
        source: spec.sources[0].place,
        ground_amsl_m: spec.ground_amsl_m,
        gas: spec.sources[0].gas,
        atmosphere: spec.atmosphere,
    }
}

/// Readings of moments at points, platform by platform in order of time.
pub fn samples(frame: &LocalFrame, observations: &Observations) -> Vec<Sample> {
    let sample = |row: &ObservationRow| {
        let of_a_place = row.averaging_s.is_none() && row.line_end.is_none();
        row.co2_ppm.filter(|_| of_a_place).map(|ppm| Sample {
            platform: row.platform,
            time_s: row.time_s,
            place: row.place(frame),
            ppm,
        })
    };
    let mut samples: Vec<Sample> = observations.rows.iter().filter_map(sample).collect();
    samples.sort_by_key(|s| s.platform);
    samples
}

/// Mean height of readings above ground, m.
pub(crate) fn mean_height_agl_m(samples: &[Sample]) -> f64 {
    samples.iter().map(|s| s.place.height_agl_m).sum::<f64>() / samples.len() as f64
}

/// The wind at a height over a time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MeanWind {
    /// Mean as a vector.
    pub vector: WindVector,
    /// Mean speed, m/s.
    pub speed_m_s: f64,
    /// Whether it was logged; else it is the scenario's.
    pub is_logged: bool,
}

impl MeanWind {
    /// Standard deviation of ln of its speed.
    pub fn speed_ln_sd(self) -> f64 {
        if self.is_logged {
            LOGGED_SPEED_LN_SD
        } else {
            SCENARIO_SPEED_LN_SD
        }
    }
}

/// The winds that were logged, each at the height of its row.
pub(crate) struct Winds<'a> {
    spec: &'a DispersionSpec,
    exponent: f64,
    /// Time, s, height above ground, m, and wind.
    rows: Vec<(f64, f64, WindVector)>,
}

/// All times.
pub(crate) const ALWAYS: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

impl<'a> Winds<'a> {
    pub fn new(
        (scenario, spec): (&Scenario, &'a DispersionSpec),
        frame: &LocalFrame,
        observations: &Observations,
    ) -> Self {
        let wind = |row: &ObservationRow| {
            let wind =
                WindVector::from_speed_and_direction(row.wind_speed_m_s?, row.wind_from_deg?);
            Some((row.time_s, row.place(frame).height_agl_m, wind))
        };
        Self {
            spec,
            exponent: scenario.weather.wind_exponent,
            rows: observations.rows.iter().filter_map(wind).collect(),
        }
    }

    /// The mean wind at a height over a time; of all times where none was logged in it near that height, and the
    /// scenario's where none was logged at all.
    pub fn at(&self, height_agl_m: f64, during_s: [f64; 2]) -> MeanWind {
        self.logged(height_agl_m, during_s)
            .or_else(|| self.logged(height_agl_m, ALWAYS))
            .unwrap_or_else(|| {
                let vector = self.spec.wind.at(height_agl_m);
                MeanWind {
                    vector,
                    speed_m_s: vector.speed_m_s(),
                    is_logged: false,
                }
            })
    }

    fn logged(&self, height_agl_m: f64, [from_s, to_s]: [f64; 2]) -> Option<MeanWind> {
        let (mut sum, mut speeds, mut count) = (WindVector::default(), 0.0, 0.0);
        for (time_s, own_agl_m, wind) in &self.rows {
            let ratio = height_agl_m.max(LEAST_HEIGHT_M) / own_agl_m.max(LEAST_HEIGHT_M);
            if !is_same_layer(ratio) || !(from_s..=to_s).contains(time_s) {
                continue;
            }
            let factor = ratio.powf(self.exponent);
            sum.east_m_s += factor * wind.east_m_s;
            sum.north_m_s += factor * wind.north_m_s;
            speeds += factor * wind.speed_m_s();
            count += 1.0;
        }
        let vector = WindVector {
            east_m_s: sum.east_m_s / count,
            north_m_s: sum.north_m_s / count,
        };
        (count > 0.0).then_some(MeanWind {
            vector,
            speed_m_s: speeds / count,
            is_logged: true,
        })
    }
}
