//! Tracks coloured by reading, kept in bounded memory however long the mission.

use protocol::message::{Message, Reading, VehicleKind};
use protocol::{Envelope, SimTime, Topic};
use std::collections::BTreeMap;

/// A series in time that never holds more than a given number of items: when it is full, every
/// second one goes and from then on only half as many are taken.
#[derive(Debug, Clone)]
pub struct DecimatedSeries<T> {
    items: Vec<T>,
    capacity: usize,
    interval_ns: i64,
    next: SimTime,
    halvings: u32,
}

impl<T> DecimatedSeries<T> {
    /// At most `capacity` items (at least 2), at first one every `interval_s` simulated seconds.
    pub fn new(capacity: usize, interval_s: f64) -> Self {
        Self {
            items: Vec::new(),
            capacity: capacity.max(2),
            interval_ns: SimTime::from_s(interval_s).ns().max(1),
            next: SimTime::ZERO,
            halvings: 0,
        }
    }

    /// Whether an item of this time would be kept: ask before making a costly one.
    pub fn wants(&self, time: SimTime) -> bool {
        self.items.is_empty() || time >= self.next
    }

    /// Keeps the item, if one of this time is wanted. Times must not decrease.
    pub fn push(&mut self, time: SimTime, item: T) {
        if !self.wants(time) {
            return;
        }
        // Memory and what a page draws stay bounded however long a mission lasts, and the spacing stays
        // even over all of it, which dropping the oldest would not give.
        if self.items.len() == self.capacity {
            let mut keep = false;
            self.items.retain(|_| {
                keep = !keep;
                keep
            });
            self.interval_ns = self.interval_ns.saturating_mul(2);
            self.halvings += 1;
        }
        self.items.push(item);
        self.next = SimTime::from_ns(time.ns().saturating_add(self.interval_ns));
    }

    /// How often every second item has gone, the first of each pair staying: whoever has a copy of the first
    /// items follows by dropping the same ones as often.
    pub fn halvings(&self) -> u32 {
        self.halvings
    }

    /// What was kept, in order of time.
    pub fn items(&self) -> &[T] {
        &self.items
    }
}

/// A reading on a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackPoint {
    /// Time since the mission's start, s.
    pub time_s: f64,
    /// Latitude, degrees (WGS84).
    pub lat_deg: f64,
    /// Longitude, degrees (WGS84).
    pub lon_deg: f64,
    /// Altitude, m above mean sea level.
    pub alt_amsl_m: f64,
    /// CO2 mole fraction as read, ppm.
    pub co2_ppm: f64,
}

impl TrackPoint {
    /// The point of a reading.
    pub fn of(time: SimTime, reading: &Reading) -> Self {
        Self {
            time_s: time.s(),
            lat_deg: reading.lat_deg,
            lon_deg: reading.lon_deg,
            alt_amsl_m: reading.alt_amsl_m,
            co2_ppm: reading.co2_ppm,
        }
    }
}

/// The track of one vehicle.
#[derive(Debug, Clone)]
pub struct VehicleTrack {
    /// Simulated or real.
    pub kind: VehicleKind,
    /// Its points.
    pub points: DecimatedSeries<TrackPoint>,
}

/// The tracks of all vehicles, filled from readings.
#[derive(Debug, Clone)]
pub struct Tracks {
    capacity: usize,
    interval_s: f64,
    by_vehicle: BTreeMap<String, VehicleTrack>,
}

impl Tracks {
    /// At most `capacity` points a vehicle, at first one every `interval_s` simulated seconds.
    pub fn new(capacity: usize, interval_s: f64) -> Self {
        Self {
            capacity,
            interval_s,
            by_vehicle: BTreeMap::new(),
        }
    }

    /// Takes in a message; only readings matter.
    pub fn take(&mut self, topic: &Topic, envelope: &Envelope) {
        let (Topic::Reading(id), Message::Reading(reading)) = (topic, &envelope.message) else {
            return;
        };
        let point = TrackPoint::of(envelope.time, reading);
        self.push(id.as_str(), reading.kind, envelope.time, point);
    }

    /// Takes in a point of the vehicle `id`. Times must not decrease.
    pub fn push(&mut self, id: &str, kind: VehicleKind, time: SimTime, point: TrackPoint) {
        if let Some(track) = self.by_vehicle.get_mut(id) {
            track.kind = kind;
            track.points.push(time, point);
        } else {
            let mut points = DecimatedSeries::new(self.capacity, self.interval_s);
            points.push(time, point);
            self.by_vehicle
                .insert(id.to_owned(), VehicleTrack { kind, points });
        }
    }

    /// The tracks by vehicle.
    pub fn by_vehicle(&self) -> &BTreeMap<String, VehicleTrack> {
        &self.by_vehicle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    proptest::proptest! {
        #[test]
        fn bounded_ordered_and_even(capacity in 2usize..50, steps in 1usize..3000) {
            let mut kept = DecimatedSeries::new(capacity, 1.0);
            for s in 0..steps {
                kept.push(SimTime::from_s(s as f64), s);
            }
            let items = kept.items();
            proptest::prop_assert!(items.len() <= capacity && items[0] == 0);
            // Gaps differ by no more than the last doubling, and the end is not far.
            let gaps: Vec<usize> = items.windows(2).map(|w| w[1] - w[0]).collect();
            if let (Some(least), Some(greatest)) = (gaps.iter().min(), gaps.iter().max()) {
                proptest::prop_assert!(greatest <= &(2 * least), "{gaps:?}");
                proptest::prop_assert!(steps - items[items.len() - 1] <= 2 * greatest);
            }
        }
    }
}
