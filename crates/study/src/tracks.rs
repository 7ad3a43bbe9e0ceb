//! Readings along the ways of platforms that move, and the wind that blew meanwhile.

use air::geo::{Geodetic, LocalFrame};
use air::wind::WindVector;
use plume::curtain::{Sample, Site};
use plume::{DispersionSpec, Place};
use scenario::observations::{ObservationRow, Observations};

/// The site of the first source.
pub(crate) fn site(spec: &DispersionSpec) -> Site {
    Site {
        source: spec.sources[0].place,
        ground_amsl_m: spec.ground_amsl_m,
        gas: spec.sources[0].gas,
        atmosphere: spec.atmosphere,
    }
}

/// Readings of moments at points, platform by platform in order of time.
pub(crate) fn samples(frame: &LocalFrame, observations: &Observations) -> Vec<Sample> {
    let sample = |row: &ObservationRow| {
        let at = Geodetic {
            lat_deg: row.lat_deg,
            lon_deg: row.lon_deg,
        };
        let place = Place::from_geodetic(frame, at, row.alt_amsl_m);
        let of_a_place = row.averaging_s.is_none() && row.line_end.is_none();
        row.co2_ppm.filter(|_| of_a_place).map(|ppm| Sample {
            platform: row.platform,
            time_s: row.time_s,
            place,
            ppm,
        })
    };
    let mut samples: Vec<Sample> = observations.rows.iter().filter_map(sample).collect();
    samples.sort_by_key(|s| s.platform);
    samples
}

/// Mean of the winds logged in a time as a vector, and their mean speed, m/s; none where no row has one.
pub(crate) fn mean_wind(
    observations: &Observations,
    [from_s, to_s]: [f64; 2],
) -> Option<(WindVector, f64)> {
    let winds = observations
        .rows
        .iter()
        .filter(|row| (from_s..=to_s).contains(&row.time_s))
        .filter_map(|row| {
            Some(WindVector::from_speed_and_direction(
                row.wind_speed_m_s?,
                row.wind_from_deg?,
            ))
        });
    let (mut sum, mut speeds, mut count) = (WindVector::default(), 0.0, 0.0);
    for wind in winds {
        sum.east_m_s += wind.east_m_s;
        sum.north_m_s += wind.north_m_s;
        speeds += wind.speed_m_s();
        count += 1.0;
    }
    let mean = WindVector {
        east_m_s: sum.east_m_s / count,
        north_m_s: sum.north_m_s / count,
    };
    (count > 0.0).then_some((mean, speeds / count))
}

/// All times.
pub(crate) const ALWAYS: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
