//! One row of an observation track.

use crate::effects::SensorAir;
use crate::field::Place;

/// One row of an observation track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Index into the track's platforms.
    pub platform: usize,
    /// Time since mission start, s.
    pub time_s: f64,
    /// Logged place.
    pub place: Place,
    /// Wind at the place and its height: speed in m/s, from-direction in degrees; `None` takes
    /// the scenario's.
    pub wind: Option<(f64, f64)>,
    /// Logged air.
    pub air: SensorAir,
}
