//! A plan as it is flown: corners that are passed at a steady speed, for an autopilot, and the rows that
//! an aircraft would log.

use ::plume::effects::SensorAir;
use ::plume::field::DispersionModel;
use ::plume::track::{Row, Track};
use air::geo::Enu;
use air::isa::{Atmosphere, ZERO_CELSIUS_K};
use infer::InferError;

use super::super::Study;
use super::super::data::Setup;
use super::axis::PlumeAxis;
use super::plans::Plan;
use crate::verdict::Waypoint;

/// Speed of the proposed flight over ground, m/s.
pub(super) const SPEED_M_S: f64 = 18.0;
/// Steepest climb and descent of a proposed leg, m/s.
pub(super) const CLIMB_M_S: f64 = 3.0;
/// Time between rows, s.
const EVERY_S: f64 = 1.0;

/// A plan, flown from `start_s` for `length_s`.
pub(super) struct Flight<'a> {
    pub setup: &'a Setup,
    pub axis: PlumeAxis,
    pub plan: &'a Plan,
    pub start_s: f64,
    pub length_s: f64,
}

impl Flight<'_> {
    /// Times at which corners are passed, until the flight's end.
    fn timed(&self) -> Vec<(f64, [f64; 3])> {
        let mut out: Vec<(f64, [f64; 3])> = Vec::new();
        for corner in self.plan.round.iter().cycle() {
            let time_s = out.last().map_or(self.start_s, |(t, last)| {
                let way = [0, 1, 2].map(|k| corner[k] - last[k]);
                let level_m = way[0].hypot(way[1]);
                t + (level_m / SPEED_M_S)
                    .max(way[2].abs() / CLIMB_M_S)
                    .max(EVERY_S)
            });
            out.push((time_s, *corner));
            if time_s > self.start_s + self.length_s {
                break;
            }
        }
        out
    }

    /// Where to fly, for an autopilot.
    pub fn waypoints(&self) -> Vec<Waypoint> {
        let waypoint = |(time_s, point): (f64, [f64; 3])| {
            let place = self.axis.place(self.setup, point);
            let at = self.setup.frame.to_geodetic(Enu {
                east_m: place.east_m,
                north_m: place.north_m,
            });
            Waypoint {
                time_s,
                lat_deg: at.lat_deg,
                lon_deg: at.lon_deg,
                alt_amsl_m: self.setup.base.ground_amsl_m + place.height_agl_m,
            }
        };
        self.timed().into_iter().map(waypoint).collect()
    }

    /// The track that one of `platforms` logs, in the wind of the axis.
    pub fn track(
        &self,
        world: &DispersionModel,
        platforms: &[String],
        platform: usize,
        air: &Air,
    ) -> Result<Track, InferError> {
        let corners = self.timed();
        let mut rows = Vec::new();
        for k in 0..(self.length_s / EVERY_S) as usize {
            let time_s = self.start_s + EVERY_S * k as f64;
            let next = corners
                .partition_point(|c| c.0 <= time_s)
                .clamp(1, corners.len() - 1);
            let ((from_s, a), (to_s, b)) = (corners[next - 1], corners[next]);
            let part = ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
            let point = [0, 1, 2].map(|k| a[k] + part * (b[k] - a[k]));
            let place = self.axis.place(self.setup, point);
            rows.push(Row {
                platform,
                time_s,
                place,
                wind: None,
                air: air.at(self.setup.base.ground_amsl_m + place.height_agl_m),
            });
        }
        let track = Track::new(world, platforms, &rows);
        let mut track = track.map_err(|error| InferError::Model(error.to_string()))?;
        track.transport_mut().fill(self.axis.wind);
        Ok(track)
    }
}

/// The air that a flight will meet: that of a row in the middle, with the standard lapse rate.
pub(super) struct Air {
    known: SensorAir,
    column: Option<Atmosphere>,
}

impl Air {
    /// As it was logged.
    pub fn met(study: &Study<'_>) -> Self {
        let track = &study.data.track;
        let middle = track.len() / 2;
        let known = track
            .air()
            .get(middle)
            .copied()
            .unwrap_or(SensorAir::UNKNOWN);
        let height_amsl_m = study.setup.base.ground_amsl_m + track.place(middle).height_agl_m;
        let column = Atmosphere::through(height_amsl_m, known.temperature_c, known.pressure_hpa);
        Self {
            known,
            column: column.ok(),
        }
    }

    fn at(&self, alt_amsl_m: f64) -> SensorAir {
        let Some(column) = &self.column else {
            return self.known;
        };
        let air = column.at(alt_amsl_m);
        SensorAir {
            temperature_c: air.temperature_k - ZERO_CELSIUS_K,
            pressure_hpa: air.pressure_pa / 100.0,
            ..self.known
        }
    }
}
