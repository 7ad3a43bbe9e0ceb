//! Tracks in pieces: what a page that has the tracks up to some point lacks.

use record::tracks::{DecimatedSeries, TrackPoint, Tracks};
use std::collections::BTreeMap;

/// How much of one track was sent: so many of its first points, after so many halvings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Sent {
    points: usize,
    halvings: u32,
}

/// How far the tracks were sent.
#[derive(Debug, Clone, Default)]
pub(super) struct SentTracks(BTreeMap<String, Sent>);

/// A piece of a track.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Piece<'a> {
    pub id: &'a str,
    /// How often the page first drops every second of the points that it has.
    pub halvings: u32,
    /// What it then appends.
    pub points: &'a [TrackPoint],
}

impl Sent {
    /// What a page has left of the points sent once it has halved them as often as the series is now.
    fn brought_to<T>(self, series: &DecimatedSeries<T>) -> Self {
        let halvings = series.halvings();
        let points = (self.halvings..halvings).fold(self.points, |n, _| n.div_ceil(2));
        Self {
            points: points.min(series.items().len()),
            halvings,
        }
    }
}

impl SentTracks {
    /// What is new in `tracks`, which counts as sent from now on.
    pub fn news<'a>(&mut self, tracks: &'a Tracks) -> Vec<Piece<'a>> {
        let mut pieces = Vec::new();
        for (id, track) in tracks.by_vehicle() {
            let sent = self.0.entry(id.clone()).or_default();
            let left = sent.brought_to(&track.points);
            let points = &track.points.items()[left.points..];
            let halvings = left.halvings - sent.halvings;
            *sent = Sent {
                points: track.points.items().len(),
                ..left
            };
            if !points.is_empty() || halvings > 0 {
                pieces.push(Piece {
                    id,
                    halvings,
                    points,
                });
            }
        }
        pieces
    }

    /// All that there is, in pieces of at most `most` points, for a page that has nothing.
    pub fn all(tracks: &Tracks, most: usize) -> Vec<Piece<'_>> {
        let by_vehicle = tracks.by_vehicle().iter();
        let pieces = by_vehicle.flat_map(|(id, track)| {
            track
                .points
                .items()
                .chunks(most.max(1))
                .map(|points| Piece {
                    id,
                    halvings: 0,
                    points,
                })
        });
        pieces.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::message::{Message, Reading, VehicleKind};
    use protocol::{Envelope, SimTime, Topic};

    fn reading(second: u32) -> (Topic, Envelope) {
        let reading = Reading {
            kind: VehicleKind::Simulated,
            lat_deg: 43.0,
            lon_deg: -7.0,
            alt_amsl_m: 500.0,
            co2_ppm: f64::from(second),
            wind_speed_m_s: None,
            wind_from_deg: None,
            temperature_c: None,
            pressure_hpa: None,
            time_ns: None,
        };
        let name = protocol::key::Name::new("1").unwrap();
        let topic = Topic::Reading(name.clone());
        let envelope = Envelope {
            time: SimTime::from_s(f64::from(second)),
            sequence: u64::from(second),
            sender: protocol::AgentId::va("1").unwrap(),
            message: Message::Reading(reading),
        };
        (topic, envelope)
    }

    proptest::proptest! {
        /// A page that takes every piece has the very track, whenever the pieces were asked for.
        #[test]
        fn pieces_make_the_track(steps in 1u32..400, asked in proptest::collection::vec(0u32..400, 0..30)) {
            let mut tracks = Tracks::new(16, 1.0);
            let mut sent = SentTracks::default();
            let mut page: Vec<TrackPoint> = Vec::new();
            for second in 0..steps {
                let (topic, envelope) = reading(second);
                tracks.take(&topic, &envelope);
                if asked.contains(&second) || second + 1 == steps {
                    for piece in sent.news(&tracks) {
                        for _ in 0..piece.halvings {
                            page = page.into_iter().step_by(2).collect();
                        }
                        page.extend_from_slice(piece.points);
                    }
                }
            }
            proptest::prop_assert_eq!(&page, tracks.by_vehicle()["1"].points.items());
            let all: Vec<TrackPoint> = SentTracks::all(&tracks, 5).into_iter().flat_map(|p| p.points.to_vec()).collect();
            proptest::prop_assert_eq!(page, all);
        }
    }
}
