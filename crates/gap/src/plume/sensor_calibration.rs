//! Sensors of a network: each that stands still has a zero of its own, and a gain, which are part of the base
//! and no causes.
//!
//! What a sensor reads in clean air is told by its lowest readings while the wind does not blow from a source to
//! it, because gas comes on top of clean air and never below it. No number here is a concentration.

use ::plume::DispersionSpec;
use ::plume::field::Place;
use ::plume::mechanism::MechanismId;
use ::plume::track::Row;
use air::wind::WindVector;
use scenario::uncertain::usual;

use super::model::Unknown;

/// A platform stands still where so large a part of its places is so near to their middle, m, along the ground and in
/// height: what position fixes of one place differ by, as for [`super::pair`].
const STANDS_PART: f64 = 0.95;
const STANDS_WITHIN_M: f64 = 5.0;
const STANDS_WITHIN_HEIGHT_M: f64 = 3.0;
/// Fewest platforms that stand still of a network: one sensor's zero is the background's.
const FEWEST: usize = 2;
/// A source's plume does not reach places farther than this from its axis, degrees: over two standard deviations
/// of the direction in class A (US EPA 2000, table 6-8a).
const BESIDE_DEG: f64 = 60.0;
/// The part of the readings in such a wind that is clean air, and fewest of them to tell it by.
const CLEAN_PART: f64 = 0.1;
const FEWEST_CLEAN: usize = 30;
/// A zero is believed to be off by no more than so many standard deviations of what is known of levels; one that is
/// seen further off is known no better than that.
const PLAUSIBLE_SDS: f64 = 3.0;
/// Standard deviation of the logarithm of a sensor's gain: what span gas leaves of a calibration in the field.
const LN_GAIN_SD: f64 = 0.1;

/// What all sensors share of their levels, background and a zero of all, is told in their own zeros: it keeps this
/// part of the standard deviation that it has beforehand.
pub const HELD: f64 = 1e-3;

/// The zeros and gains of the sensors of a network, as unknowns of a model whose world is `spec`: of `platforms`
/// platforms with these rows, which read `excess` above what this world has without its plume, not finite where a
/// reading does not count. `sensor_sd` is the sensor's own noise and `level_sd` what is known of background and zeros
/// beforehand, both in the unit of the readings. Nothing where fewer than two platforms stand still.
///
/// Where there is a network, platforms that move have a zero of their own too, and what all share of their levels
/// is to be held ([`HELD`]): a zero is known as what a sensor reads, whatever of it is background.
pub(super) fn own_zeros(
    spec: &DispersionSpec,
    platforms: usize,
    rows: &[Row],
    excess: &[f64],
    sensor_sd: f64,
    level_sd: f64,
) -> Vec<Unknown> {
    // Of who reads: a mast that logs the wind has no zero.
    let read_by = |p: usize| {
        let own = rows.iter().zip(excess);
        own.filter(move |(r, c)| r.platform == p && c.is_finite())
            .map(|(r, _)| r)
    };
    let standing: Vec<Option<Place>> = (0..platforms).map(|p| stands_at(read_by(p))).collect();
    if standing.iter().flatten().count() < FEWEST {
        return Vec::new();
    }
    let mut out = Vec::new();
    for (platform, at) in standing.into_iter().enumerate() {
        if read_by(platform).next().is_none() {
            continue;
        }
        let of = |id, setting, mean, sd| Unknown {
            id,
            platform: Some(platform),
            setting,
            prior: infer::Prior { mean, sd },
        };
        // The gain turns about the background, so that it does not move the zero.
        if at.is_some() {
            let pivot = Some(spec.background_ppm);
            out.push(of(MechanismId::SensorGain, pivot, 0.0, LN_GAIN_SD));
        }
        let off = at.and_then(|at| clean_level(spec, at, platform, rows, excess));
        let (mean, sd) = match off {
            Some(off) if off.abs() <= PLAUSIBLE_SDS * level_sd => (off, sensor_sd),
            Some(off) => (off, off.abs()),
            None => (0.0, level_sd),
        };
        out.push(of(MechanismId::SensorOffset, None, mean, sd));
    }
    out
}

/// The same against the sensor of the platform `reference`, whose zero is part of the background: zeros and gains of
/// all others, those of a `network` as they are known, and of the rest as they usually are.
pub(super) fn against(
    spec: &DispersionSpec,
    mut network: Vec<Unknown>,
    reference: usize,
    platforms: usize,
) -> Vec<Unknown> {
    let is_zero = |u: &Unknown| u.id == MechanismId::SensorOffset;
    let of_reference = |u: &&Unknown| is_zero(u) && u.platform == Some(reference);
    let zero = network
        .iter()
        .find(of_reference)
        .map_or(0.0, |u| u.prior.mean);
    for own in network.iter_mut().filter(|u| is_zero(u)) {
        own.prior.mean -= zero;
    }
    network.retain(|u| u.platform != Some(reference));
    let offset_sd = usual::offset_sd_ppm(spec.sensor.noise_sd_ppm, spec.background_ppm);
    let usual = [
        (MechanismId::SensorOffset, offset_sd),
        (MechanismId::SensorGain, usual::GAIN_SD),
    ];
    let known = |platform: &usize| network.iter().any(|u| u.platform == Some(*platform));
    let others = (0..platforms).filter(|p| *p != reference && !known(p));
    let own = others.flat_map(|platform| {
        usual.map(|(id, sd)| Unknown {
            id,
            platform: Some(platform),
            setting: None,
            prior: infer::Prior { mean: 0.0, sd },
        })
    });
    let own: Vec<Unknown> = own.collect();
    network.extend(own);
    network
}

/// Where rows are, if they are of one place.
pub(super) fn stands_at<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<Place> {
    let places: Vec<Place> = rows.map(|r| r.place).collect();
    let middle = |of: fn(&Place) -> f64| quantile(places.iter().map(of).collect(), 0.5);
    let at = Place {
        east_m: middle(|p| p.east_m)?,
        north_m: middle(|p| p.north_m)?,
        height_agl_m: middle(|p| p.height_agl_m)?,
    };
    let is_near = |p: &&Place| {
        (p.east_m - at.east_m).hypot(p.north_m - at.north_m) <= STANDS_WITHIN_M
            && (p.height_agl_m - at.height_agl_m).abs() <= STANDS_WITHIN_HEIGHT_M
    };
    let near = places.iter().filter(is_near).count();
    (near as f64 >= STANDS_PART * places.len() as f64).then_some(at)
}

/// What a sensor reads above what is expected in clean air; none where it is seldom known to be in it.
fn clean_level(
    spec: &DispersionSpec,
    at: Place,
    platform: usize,
    rows: &[Row],
    excess: &[f64],
) -> Option<f64> {
    let is_clean = |row: &Row| {
        let from_deg = row.wind.map_or(spec.wind.from_deg(), |(_, from)| from);
        let towards = WindVector::from_speed_and_direction(1.0, from_deg);
        spec.sources.iter().all(|source| {
            let (east, north) = (
                at.east_m - source.place.east_m,
                at.north_m - source.place.north_m,
            );
            let along = east * towards.east_m_s + north * towards.north_m_s;
            along < BESIDE_DEG.to_radians().cos() * east.hypot(north)
        })
    };
    let own = rows.iter().zip(excess);
    let clean: Vec<f64> = own
        .filter(|(row, c)| row.platform == platform && c.is_finite() && is_clean(row))
        .map(|(_, c)| *c)
        .collect();
    if clean.len() < FEWEST_CLEAN {
        return None;
    }
    quantile(clean, CLEAN_PART)
}

/// The value that this part of `values` does not exceed; none of nothing.
fn quantile(mut values: Vec<f64>, part: f64) -> Option<f64> {
    let k = (part * values.len().checked_sub(1)? as f64).round() as usize;
    Some(*values.select_nth_unstable_by(k, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::plume::effects::SensorAir;
    use scenario::Scenario;

    /// Platforms round a source that read `level` in clean air and more while the wind blows from the source to them.
    fn network(levels: &[f64], step_m: f64) -> (DispersionSpec, Vec<Row>, Vec<f64>) {
        let text = "[site]\nlat_deg=40\nlon_deg=-105\nground_amsl_m=1500\n\
            [[source]]\ngas=\"ch4\"\nlat_deg=40\nlon_deg=-105\nemission_kg_s=1e-3\n\
            [background]\nch4_ppm=2\n";
        let spec = Scenario::parse("s", text)
            .unwrap()
            .dispersion_spec()
            .unwrap();
        let (mut rows, mut excess) = (Vec::new(), Vec::new());
        for (platform, level) in levels.iter().enumerate() {
            let bearing = 360.0 / levels.len() as f64 * platform as f64;
            for k in 0..720 {
                let from_deg = f64::from(k);
                let off_deg = (from_deg + 180.0 - bearing).rem_euclid(360.0);
                let (sin, cos) = bearing.to_radians().sin_cos();
                let far_m = 50.0 + step_m * f64::from(k);
                rows.push(Row {
                    platform,
                    time_s: f64::from(k),
                    place: Place {
                        east_m: far_m * sin,
                        north_m: far_m * cos,
                        height_agl_m: 2.0,
                    },
                    wind: Some((2.0, from_deg)),
                    air: SensorAir::UNKNOWN,
                });
                let plume = if off_deg.min(360.0 - off_deg) < 30.0 {
                    10.0
                } else {
                    0.0
                };
                excess.push(level - spec.background_ppm + plume);
            }
        }
        (spec, rows, excess)
    }

    #[test]
    fn standing_sensors_have_zeros_by_their_lowest_readings_beside_the_plume() {
        let (spec, rows, excess) = network(&[1.7, 2.1, 1.9], 0.0);
        let own = own_zeros(&spec, 3, &rows, &excess, 0.03, 0.3);
        let zeros: Vec<_> = own
            .iter()
            .filter(|u| u.id == MechanismId::SensorOffset)
            .collect();
        for (zero, off) in zeros.iter().zip([-0.3, 0.1, -0.1]) {
            assert!((zero.prior.mean - off).abs() < 1e-9 && zero.prior.sd == 0.03);
        }
        assert_eq!((own.len(), zeros.len()), (6, 3));
        // Further off than is plausible, or never in clean air: known no better.
        let far = own_zeros(&spec, 3, &rows, &excess, 0.03, 0.03);
        assert!((far[1].prior.sd - 0.3).abs() < 1e-9);
        let mut steady = rows.clone();
        steady.iter_mut().for_each(|r| r.wind = Some((2.0, 180.0)));
        let downwind = own_zeros(&spec, 3, &steady, &excess, 0.03, 0.3);
        assert_eq!((downwind[1].prior.mean, downwind[1].prior.sd), (0.0, 0.3));
    }

    #[test]
    fn what_moves_is_no_network() {
        let (spec, rows, excess) = network(&[1.7, 2.1], 1.0);
        assert!(own_zeros(&spec, 2, &rows, &excess, 0.03, 0.3).is_empty());
        let (spec, rows, excess) = network(&[1.7], 0.0);
        assert!(own_zeros(&spec, 1, &rows, &excess, 0.03, 0.3).is_empty());
    }
}
