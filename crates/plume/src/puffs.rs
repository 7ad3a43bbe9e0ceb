//! Puffs carried by the wind's history against the straight plume's formula.
//!
//! A plume in a wind that changes is not straight: what is met at a distance was emitted
//! earlier, went where the wind of the time between took it, is as dilute as the wind's speed
//! at its emission made it, and reaches as far along the wind as across it. A sum of Gaussian
//! puffs has all of that (Seinfeld and Pandis 2016, section 18.9); the ratio of that sum to the
//! straight plume is taken once for each reading and then multiplies the formula.

use super::{DispersionModel, Place, SourceTerm, Transport, rotate};

/// Where the air has gone since a time, on an even grid of times.
#[derive(Debug, Clone, PartialEq)]
pub struct WindHistory {
    start_s: f64,
    step_s: f64,
    /// Metres east, north and of path since the start.
    displacement_m: Vec<[f64; 3]>,
    growth: Growth,
}

/// What a puff's spread grows with.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Growth {
    /// The path that it has gone.
    Path,
    /// The time that it has been under way, at this speed, m/s.
    Time(f64),
}

/// Nodes of the midpoint rule over the puffs' ages. A test holds the sum within 1 % of one over a
/// puff every tenth of a second; the integrand goes to zero at both ends, where the rule converges
/// fast.
const NODES: usize = 18;
/// Puffs up to this many of their spread before and behind a place count. More behind: older puffs
/// are wider than the spread at the place.
const REACH: (f64, f64) = (3.2, 4.0);
/// Bounds of the ratio: beyond, the straight formula has next to nothing to multiply.
const RATIO: (f64, f64) = (0.1, 10.0);
/// Least speed by which ages are reckoned, m/s: in a calm a puff would be under way for ever.
const LEAST_SPEED_M_S: f64 = 0.3;

impl WindHistory {
    /// The history of a wind given as metres a second towards east and north, every `step_s`
    /// from `start_s`. Before it the first wind stands, after it the last.
    pub fn new(start_s: f64, step_s: f64, wind_m_s: &[[f64; 2]]) -> Self {
        let mut sum = [0.0; 3];
        let mut displacement_m = vec![sum];
        for w in wind_m_s {
            sum[0] += w[0] * step_s;
            sum[1] += w[1] * step_s;
            sum[2] += w[0].hypot(w[1]) * step_s;
            displacement_m.push(sum);
        }
        Self {
            start_s,
            step_s,
            displacement_m,
            growth: Growth::Path,
        }
    }

    /// The same for puffs that grow with the time that they have been under way, at the mean speed
    /// of this wind, and no faster in a gust: turbulence acts for as long as it has (Taylor 1921),
    /// and the spread that is stated by distance holds in the mean wind.
    pub fn growing_with_time(mut self) -> Self {
        let length_s = (self.displacement_m.len() - 1).max(1) as f64 * self.step_s;
        let path_m = self.displacement_m.last().map_or(0.0, |m| m[2]);
        self.growth = Growth::Time(path_m / length_s);
        self
    }

    /// The distance by which a puff has grown that has gone `path_m` in `ago_s`.
    fn grown_m(&self, path_m: f64, ago_s: f64) -> f64 {
        match self.growth {
            Growth::Path => path_m,
            Growth::Time(speed_m_s) => speed_m_s * ago_s,
        }
    }

    /// Metres east, north and of path since the start, carried on before and after.
    fn at(&self, time_s: f64) -> [f64; 3] {
        let last = self.displacement_m.len() - 1;
        if last == 0 {
            return [0.0; 3];
        }
        let place = (time_s - self.start_s) / self.step_s;
        let i = (place.max(0.0) as usize).min(last - 1);
        let part = place - i as f64;
        let (a, b) = (self.displacement_m[i], self.displacement_m[i + 1]);
        std::array::from_fn(|k| a[k] + part * (b[k] - a[k]))
    }

    /// Metres east, north and of path that the air has gone from `ago_s` before `time_s` to
    /// then.
    pub(crate) fn travelled_m(&self, time_s: f64, ago_s: f64) -> [f64; 3] {
        let (now, then) = (self.at(time_s), self.at(time_s - ago_s));
        std::array::from_fn(|k| now[k] - then[k])
    }

    /// The mean transport over the way of the air that has gone `distance_m` at `time_s`.
    pub fn mean_transport(&self, time_s: f64, distance_m: f64) -> Transport {
        let mut ago_s = 1.0f64.max(distance_m / self.speed_m_s(time_s));
        // The mean speed over the way, not that of the moment, tells when the air set out.
        for _ in 0..3 {
            let path = self.travelled_m(time_s, ago_s)[2].max(1e-3);
            ago_s = (ago_s * distance_m / path).clamp(1.0, 1e5);
        }
        let [east, north, _] = self.travelled_m(time_s, ago_s);
        let length = east.hypot(north).max(1e-9);
        Transport {
            east: east / length,
            north: north / length,
            speed_m_s: length / ago_s,
        }
    }

    fn speed_m_s(&self, time_s: f64) -> f64 {
        (self.travelled_m(time_s, 1.0)[2]).max(LEAST_SPEED_M_S)
    }
}

impl DispersionModel {
    /// Ratio of the puffs of plume `which` ([`DispersionModel::plume_count`]) to its straight plume at a
    /// place and time, for the `wind` that the straight plume is given; 1 where the straight plume
    /// has nothing.
    ///
    /// Decay and loss to the ground are taken as the same in both, and a wind that veers with
    /// height as turning both alike.
    pub fn puffs_over_plume(
        &self,
        history: &WindHistory,
        which: usize,
        place: &Place,
        time_s: f64,
        wind: Transport,
    ) -> f64 {
        let Some(plume) = self.plumes.get(which) else {
            return 1.0;
        };
        let mut turned = rotate(wind, self.rotation);
        turned.speed_m_s *= self.effects.speed_factor;
        let (straight, _, speed) = self.gaussian_shape(plume, place, turned);
        if straight < 1e-12 {
            return 1.0;
        }
        let to = [place.east_m - plume.east_m, place.north_m - plume.north_m];
        let distance_m = to[0].hypot(to[1]);
        let reach = self.sigmas_m(distance_m).0;
        let speed_factor = self.effects.speed_factor * plume.speed_ratio;
        // Ages between which a puff can touch the place, by the mean speed over the way.
        let mean = (wind.speed_m_s * speed_factor).max(LEAST_SPEED_M_S);
        let first = ((distance_m - REACH.0 * reach) / mean).max(1.0);
        let last = ((distance_m + REACH.1 * reach) / mean).max(first + 1.0);
        let step = (last - first) / NODES as f64;
        let mut sum = 0.0;
        for k in 0..NODES {
            let ago = first + (k as f64 + 0.5) * step;
            let [east, north, path] = history.travelled_m(time_s, ago);
            let towards = rotate(
                Transport {
                    east,
                    north,
                    speed_m_s: 0.0,
                },
                self.rotation,
            );
            let towards = self.veered(plume, place, towards);
            let grown = history.grown_m(path, ago);
            // Along the wind a puff is as wide as across it, σx = σy (Turner 1970).
            let (y, z) = self.sigmas_m((grown * speed_factor).max(1.0));
            let away_sq = (to[0] - towards.east * speed_factor).powi(2)
                + (to[1] - towards.north * speed_factor).powi(2);
            let across = 0.5 * away_sq / (y * y);
            sum += self
                .reflection
                .profile(place.height_agl_m, plume.height_m, z, across)
                / (y * y * z);
        }
        // A puff of Q dt has Q dt / ((2π)^(3/2) σy² σz) in its centre and the plume Q / (2π u σy σz)
        // on its axis: what stands before the ratio of their shapes is u dt / √(2π).
        sum *= step / std::f64::consts::TAU.sqrt();
        let height = self.spec.sources[0].effective_height_agl_m;
        let dilution = match plume.source_term {
            SourceTerm::MolarRate(_) => speed,
            // A stated c_MAX holds in the scenario's mean wind.
            SourceTerm::AxisConcentration(_) => {
                self.spec.wind.speed_at_m_s(height) * self.effects.speed_factor
            }
        };
        (sum * dilution / straight).clamp(RATIO.0, RATIO.1)
    }

    /// What a wind of the moment does to a plume that is given by its c_MAX: as much more dilute
    /// as it is faster than the scenario's. 1 for a plume given by its emission, whose formula
    /// has the speed.
    pub fn dilution_of_moment(&self, wind: Transport) -> f64 {
        let height = self.spec.sources[0].effective_height_agl_m;
        match self.plumes.first().map(|p| &p.source_term) {
            Some(SourceTerm::AxisConcentration(_)) => {
                self.spec.wind.speed_at_m_s(height) / wind.speed_m_s.max(LEAST_SPEED_M_S)
            }
            _ => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::spec;
    use super::*;

    /// Direction towards (from east, anticlockwise, rad) and speed of a wandering wind.
    fn wandering(t: f64) -> [f64; 2] {
        let angle = 0.3 + 0.05 * (t / 90.0).sin() + 0.012 * (t / 17.0).cos();
        let speed = 6.0 * (1.0 + 0.06 * (t / 70.0).sin());
        [speed * angle.cos(), speed * angle.sin()]
    }

    // Against a sum over a puff every tenth of a second, written out with the formulas.
    #[test]
    fn the_ratio_turns_the_straight_plume_into_puffs() {
        let growths: [fn(&WindHistory, f64, f64) -> f64; 2] = [
            |history, time_s, ago_s| history.travelled_m(time_s, ago_s)[2],
            // 1200 s at 6 m/s and what the sine has left over.
            |_, _, ago_s| {
                6.0 * (1.0 + 0.06 * (1.0 - (1200.0f64 / 70.0).cos()) * 70.0 / 1200.0) * ago_s
            },
        ];
        for (with_time, grown) in [false, true].into_iter().zip(growths) {
            ratio_against_a_sum(with_time, grown);
        }
    }

    fn ratio_against_a_sum(with_time: bool, grown: fn(&WindHistory, f64, f64) -> f64) {
        let mut wide = spec(crate::Strength::EmissionKgS(100.0));
        wide.stability = crate::stability::Stability::B;
        wide.ground_reflection = true;
        let model = DispersionModel::new(wide).unwrap();
        let wind: Vec<[f64; 2]> = (0..1200).map(|k| wandering(f64::from(k) + 0.5)).collect();
        let mut history = WindHistory::new(0.0, 1.0, &wind);
        if with_time {
            history = history.growing_with_time();
        }
        let source = model.spec().sources[0].clone();
        for (along, across, time) in [
            (700.0, 20.0, 700.0),
            (1500.0, -150.0, 900.0),
            (2500.0, 200.0, 1100.0),
        ] {
            let place = Place {
                east_m: source.place.east_m + along * 0.3f64.cos() - across * 0.3f64.sin(),
                north_m: source.place.north_m + along * 0.3f64.sin() + across * 0.3f64.cos(),
                height_agl_m: source.effective_height_agl_m,
            };
            let transport = history.mean_transport(time, along.hypot(across));
            let ratio = model.puffs_over_plume(&history, 0, &place, time, transport);
            let plume = model.plumes[0].clone();
            let (straight, _, speed) = model.shape_with_losses(&plume, &place, transport);
            let mut sum = 0.0;
            for k in 1..9000 {
                let ago_s = 0.1 * f64::from(k);
                let moved = history.travelled_m(time, ago_s);
                let (y, z) = model.sigmas_m(grown(&history, time, ago_s));
                let d_sq = (place.east_m - source.place.east_m - moved[0]).powi(2)
                    + (place.north_m - source.place.north_m - moved[1]).powi(2);
                let h = source.effective_height_agl_m;
                let vertical = 1.0 + (-0.5 * (2.0 * h / z).powi(2)).exp();
                sum += 0.1 * (-0.5 * d_sq / (y * y)).exp() * vertical / (y * y * z);
            }
            let puffs = sum / std::f64::consts::TAU.sqrt();
            let mine = straight * ratio
                / match plume.source_term {
                    SourceTerm::MolarRate(_) => speed,
                    SourceTerm::AxisConcentration(_) => model
                        .spec()
                        .wind
                        .speed_at_m_s(source.effective_height_agl_m),
                };
            println!("{along} {across}: ratio {ratio} {}", mine / puffs);
            assert!(
                (mine / puffs - 1.0).abs() < 0.01,
                "{along} {across}: {}",
                mine / puffs
            );
        }
    }

    // Losses and a veer are the straight plume's, which the ratio multiplies.
    #[test]
    fn losses_and_veer_leave_the_ratio() {
        let plain = spec(crate::Strength::EmissionKgS(100.0));
        let wind: Vec<[f64; 2]> = (0..1200).map(|k| wandering(f64::from(k) + 0.5)).collect();
        let history = WindHistory::new(0.0, 1.0, &wind);
        let source = plain.sources[0].clone();
        let at = |along: f64, up: f64| Place {
            east_m: source.place.east_m + along * 0.3f64.cos(),
            north_m: source.place.north_m + along * 0.3f64.sin(),
            height_agl_m: source.effective_height_agl_m + up,
        };
        let ratio = |mechanism: Option<crate::Mechanism>, place: Place| {
            let mut spec = plain.clone();
            spec.mechanisms.extend(mechanism);
            let model = DispersionModel::new(spec).unwrap();
            let transport = history.mean_transport(900.0, 1500.0);
            model.puffs_over_plume(&history, 0, &place, 900.0, transport)
        };
        for (id, name, value) in [
            ("first-order-decay", "rate_per_s", 1e-3),
            ("dry-deposition", "velocity_m_s", 0.05),
            ("wind-veer-with-height", "rate_deg_per_100m", 8.0),
        ] {
            let own = crate::Mechanism::new(id, &[(name, value)]).unwrap();
            let (with, without) = (
                ratio(Some(own), at(1500.0, 0.0)),
                ratio(None, at(1500.0, 0.0)),
            );
            assert!(
                (with / without - 1.0).abs() < 1e-9,
                "{id}: {with} {without}"
            );
        }
        // 40 m up a veer of 5 degrees in 100 m turns the plume by 2 degrees.
        let veer =
            crate::Mechanism::new("wind-veer-with-height", &[("rate_deg_per_100m", 5.0)]).unwrap();
        let turn = crate::Mechanism::new("wind-direction-offset", &[("offset_deg", 2.0)]).unwrap();
        let (veered, turned) = (
            ratio(Some(veer), at(1500.0, 40.0)),
            ratio(Some(turn), at(1500.0, 40.0)),
        );
        assert!((veered / turned - 1.0).abs() < 1e-9, "{veered} {turned}");
    }

    // The wind is one for the whole site: a second source's puffs are the first one's, moved.
    #[test]
    fn every_plume_has_puffs_of_its_own() {
        let mut both = spec(crate::Strength::EmissionKgS(100.0));
        let moved = [("east_m", 400.0), ("north_m", -250.0), ("ratio", 0.3)];
        let second = crate::Mechanism::new("second-source", &moved).unwrap();
        both.mechanisms.push(second);
        let model = DispersionModel::new(both).unwrap();
        assert_eq!(model.plume_count(), 2);
        let wind: Vec<[f64; 2]> = (0..1200).map(|k| wandering(f64::from(k) + 0.5)).collect();
        let history = WindHistory::new(0.0, 1.0, &wind);
        let source = model.spec().sources[0].clone();
        let transport = history.mean_transport(900.0, 1500.0);
        let ratio = |which: usize, east_m: f64, north_m: f64| {
            let place = Place {
                east_m: source.place.east_m + east_m,
                north_m: source.place.north_m + north_m,
                height_agl_m: source.effective_height_agl_m,
            };
            model.puffs_over_plume(&history, which, &place, 900.0, transport)
        };
        let own = ratio(0, 1400.0, 450.0);
        assert!((ratio(1, 1800.0, 200.0) / own - 1.0).abs() < 1e-9);
        assert!((ratio(1, 1400.0, 450.0) / own - 1.0).abs() > 0.1);
    }
}
