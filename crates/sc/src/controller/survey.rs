//! Passes through a plume that has been located, chosen by what they are expected to tell.

use protocol::message::{Model, Severity};
use protocol::{Outbox, SimTime};

use super::dispatch::{CLIMB_M_S, TURN_RADIUS_M};
use super::{HALF_WIDTH_95_SD, SquadronController};
use crate::fleet::{ORBIT_M, REACHED_M, VehicleTrack};
use crate::information::{AxisCrossing, Information, KnownPlume, Precision};
use crate::passes::{self, Pass};
use crate::plume_estimate::PlumeEstimate;
use crate::tasks::VehicleTask;
use air::geo::{Enu, wrap_signed_deg};
use std::f64::consts::TAU;

/// The last crossings that count: of earlier ones no eddies are left, and what they told is little beside the others.
const MOST_CROSSINGS: usize = 60;
/// Passes that are tried, the best first, where others are in the way.
const TRIED: usize = 10;
/// A vehicle that passes from one side of the axis to the other within a decision has crossed it no farther off than
/// this, m.
const CROSSED_WITHIN_M: f64 = 100.0;
/// Crossings that are looked ahead at most.
const AHEAD: usize = 60;

/// Crossings of the axis by real vehicles.
#[derive(Debug)]
pub(super) struct Survey {
    crossings: Vec<AxisCrossing>,
    /// How far each vehicle was to the right of the axis, m.
    right_m: Vec<Option<f64>>,
}

impl Survey {
    pub(super) fn of(vehicles: usize) -> Self {
        Self {
            crossings: Vec::new(),
            right_m: vec![None; vehicles],
        }
    }

    fn note(&mut self, vehicle: usize, right_m: f64, crossing: AxisCrossing) {
        let before_m = self.right_m[vehicle].replace(right_m);
        let near = right_m.abs() < CROSSED_WITHIN_M && crossing.distance_m > 0.0;
        if near && before_m.is_some_and(|m| m.abs() < CROSSED_WITHIN_M && m * right_m <= 0.0) {
            self.crossings.push(crossing);
            if self.crossings.len() > MOST_CROSSINGS {
                self.crossings.remove(0);
            }
        }
    }
}

/// A pass with what it costs and tells.
struct Candidate {
    pass: Pass,
    crossing: AxisCrossing,
    /// When it is flown, s.
    end_s: f64,
    /// Nats gained a second.
    rate: f64,
}

impl SquadronController {
    /// Notes where real vehicles have crossed the axis.
    pub(super) fn note_crossings(&mut self, now: SimTime) {
        let Some(estimate) = self.estimate() else {
            return;
        };
        for (index, vehicle) in self.fleet.vehicles.iter().enumerate() {
            let Some(track) = vehicle.track.filter(|t| vehicle.real && t.airborne) else {
                continue;
            };
            let [distance_m, right_m] = estimate.along_and_right_m(track.position.at);
            let crossing = AxisCrossing {
                time_s: now.s(),
                distance_m,
                height_amsl_m: track.position.height_m,
            };
            self.survey.note(index, right_m, crossing);
        }
    }

    /// Passes for a vehicle, those first that are expected to tell most a second, beside those that other vehicles fly.
    pub(super) fn informative_passes(&self, index: usize, now: SimTime) -> Vec<Pass> {
        let Some(track) = self.fleet.vehicles[index].track else {
            return Vec::new();
        };
        let ranked = self.with_information(|information| {
            let information = self.with_passes_under_way(information, index, now);
            self.ranked(&information, &track, now.s())
        });
        let passes = ranked.unwrap_or_default().into_iter();
        passes.take(TRIED).map(|c| c.pass).collect()
    }

    /// Says how well the peak and the flux are known by the crossings so far, and how well they may be known when the
    /// vehicles go home.
    pub(super) fn publish_expected_precision(&self, now: SimTime, out: &mut Outbox) {
        let vehicles = self.fleet.vehicles.iter();
        let real = vehicles.filter(|v| v.real && v.is_commandable());
        let tracks: Vec<VehicleTrack> = real.filter_map(|v| v.track).collect();
        let until_s = self.home_time_s();
        let expected = self.with_information(|mut information| {
            let before = information.precision();
            let flown = self.look_ahead(&mut information, &tracks, now.s(), until_s);
            (before, information.precision(), flown)
        });
        if let Some((before, after, flown)) = expected {
            let percent = |sd: f64| 100.0 * HALF_WIDTH_95_SD * sd;
            let text = format!(
                "by the crossings so far the 95 % interval of the peak's excess is ± {:.0} % at best, that of the flux \
                 ± {:.0} % beside the wind; {flown} more by {:.0} min may narrow them to ± {:.0} % and ± {:.0} %",
                percent(before.peak),
                percent(before.flux),
                until_s / 60.0,
                percent(after.peak),
                percent(after.flux),
            );
            out.event(&self.id, Severity::Info, "expected-precision", text);
        }
    }

    /// Adds the best passes of the vehicles at `tracks` one after the other until `until_s`; how many.
    fn look_ahead(
        &self,
        information: &mut Information<'_>,
        tracks: &[VehicleTrack],
        now_s: f64,
        until_s: f64,
    ) -> usize {
        let mut next: Vec<(f64, VehicleTrack)> = tracks.iter().map(|t| (now_s, *t)).collect();
        for flown in 0..AHEAD {
            next.sort_by(|a, b| b.0.total_cmp(&a.0));
            let Some((time_s, track)) = next.pop() else {
                return flown;
            };
            let ranked = self.ranked(information, &track, time_s);
            let Some(best) = ranked.into_iter().next().filter(|c| c.end_s < until_s) else {
                return flown;
            };
            information.add(best.crossing);
            let (from, to) = (best.pass.from, best.pass.to);
            let track = VehicleTrack {
                position: to,
                course_deg: from.at.bearing_deg(to.at),
                ..track
            };
            next.push((best.end_s, track));
        }
        AHEAD
    }

    /// Passes from where a vehicle is at `time_s`, the most informative a second first.
    fn ranked(
        &self,
        information: &Information<'_>,
        track: &VehicleTrack,
        time_s: f64,
    ) -> Vec<Candidate> {
        let (before, asked) = (information.precision(), self.asked_precision());
        let passes = passes::candidates().filter_map(|c| self.plan_pass(c, track.position.at));
        let candidate = |pass: Pass| {
            let (crossed_s, ended_s) = self.times_of_s(&pass, track);
            let crossing = AxisCrossing {
                time_s: time_s + crossed_s,
                distance_m: pass.distance_m,
                height_amsl_m: pass.axis.height_m,
            };
            let after = information.precision_after(&crossing);
            Candidate {
                pass,
                crossing,
                end_s: time_s + ended_s,
                rate: before.gain(&after, &asked) / ended_s,
            }
        };
        let mut all: Vec<Candidate> = passes.map(candidate).collect();
        all.sort_by(|a, b| b.rate.total_cmp(&a.rate));
        all
    }

    /// How long a vehicle takes until it crosses the axis on a pass, and until the end of it, s.
    fn times_of_s(&self, pass: &Pass, track: &VehicleTrack) -> (f64, f64) {
        let speed = self.fleet.airspeed_m_s;
        let (here, course_deg) = (track.position, track.course_deg);
        let far_m = here.at.distance_m(pass.from.at);
        let first: Enu = if far_m > REACHED_M {
            pass.from.at
        } else {
            pass.to.at
        };
        let off_deg = wrap_signed_deg(here.at.bearing_deg(first) - course_deg).abs();
        let to_start_s =
            (off_deg.to_radians() * TURN_RADIUS_M + (far_m - REACHED_M).max(0.0)) / speed;
        let half_m = pass.from.at.distance_m(pass.axis.at);
        let rest_m = (pass.axis.at.distance_m(pass.to.at) - REACHED_M).max(0.0);
        let climb_s = (pass.axis.height_m - here.height_m).abs() / CLIMB_M_S;
        let late_s = climb_s - to_start_s - pass.lead_m / speed;
        // It waits for its height in circles.
        let circle_s = TAU * ORBIT_M / speed;
        let wait_s = circle_s * (late_s / circle_s).ceil().max(0.0);
        let crossed_s = to_start_s + wait_s + half_m / speed;
        (crossed_s, crossed_s + rest_m / speed)
    }

    /// Counts passes that other vehicles fly as flown.
    fn with_passes_under_way<'p>(
        &self,
        mut information: Information<'p>,
        index: usize,
        now: SimTime,
    ) -> Information<'p> {
        let tasks = self.tasks.each.iter().zip(&self.fleet.vehicles);
        for (_, (task, vehicle)) in tasks.enumerate().filter(|(other, _)| *other != index) {
            let (VehicleTask::Approaching(pass, _) | VehicleTask::OnPass(pass)) = task else {
                continue;
            };
            let Some(track) = vehicle.track else { continue };
            let far_m = track.position.at.distance_m(pass.axis.at);
            information.add(AxisCrossing {
                time_s: now.s() + far_m / self.fleet.airspeed_m_s,
                distance_m: pass.distance_m,
                height_amsl_m: pass.axis.height_m,
            });
        }
        information
    }

    /// What the crossings so far tell of the plume, by the estimate of now.
    fn with_information<R>(&self, tell: impl FnOnce(Information<'_>) -> R) -> Option<R> {
        let (model, estimate): (&Model, PlumeEstimate) = (self.model.as_ref()?, self.estimate()?);
        let c_max_distance_m = model.c_max_distance_m.value;
        let sigma_z_m = |distance_m: f64| estimate.sigmas_m(&self.base, distance_m).1;
        let area_m2 = |distance_m: f64| {
            let (y, z) = estimate.sigmas_m(&self.base, distance_m);
            y * z
        };
        let noise = |distance_m: f64| {
            let thinner = area_m2(c_max_distance_m) / area_m2(distance_m);
            let axis_ppm = model.c_max_ppm.value * thinner;
            self.prior.noise_ppm / axis_ppm.max(f64::MIN_POSITIVE)
        };
        let mut information = Information::prior(KnownPlume {
            height_amsl_m: estimate.height_amsl_m,
            prior_sd: (
                self.prior.ln_strength_sd,
                self.prior.height_amsl_m.sd,
                self.prior.ln_spread_sd,
            ),
            c_max_distance_m,
            peak_distance_m: self.range.near_m,
            wind_m_s: model.wind_speed_m_s.max(f64::MIN_POSITIVE),
            sigma_z_m: &sigma_z_m,
            noise: &noise,
        });
        for crossing in &self.survey.crossings {
            information.add(*crossing);
        }
        Some(tell(information))
    }

    /// Standard deviations beyond which nothing more is asked for.
    fn asked_precision(&self) -> Precision {
        let (peak, flux) = self.asked_within;
        let sd = |within: Option<f64>, otherwise: f64| {
            within.map_or(otherwise, |w| w / HALF_WIDTH_95_SD)
        };
        Precision {
            peak: sd(peak, Precision::UNLIMITED.peak),
            flux: sd(flux, Precision::UNLIMITED.flux),
            ..Precision::UNLIMITED
        }
    }
}
