//! What the columns of observations may hold.

/// What a cell of a column may hold.
#[derive(Clone, Copy)]
pub(super) struct Range {
    pub low: f64,
    pub high: f64,
    /// What would be right, in words.
    pub expected: &'static str,
}

impl Range {
    /// The same from another lowest value.
    pub fn from(self, low: f64) -> Self {
        Self { low, ..self }
    }
}

const fn range(low: f64, high: f64, expected: &'static str) -> Range {
    Range {
        low,
        high,
        expected,
    }
}

/// Highest reading, ppm: twice all of the air, for what a sensor may be off; the limit of a reading on the bus.
const MOST_READING_PPM: f64 = 2e6;
/// From where depends on the readings' noise ([`Range::from`]).
pub(super) const A_READING: Range = range(
    f64::MIN,
    MOST_READING_PPM,
    "a reading no further below zero than noise and at most 2000000 ppm, or an empty cell",
);
pub(super) const A_LATITUDE: Range = range(
    -90.0,
    90.0,
    "a latitude from -90 to 90 degrees, or an empty cell",
);
pub(super) const A_LONGITUDE: Range = range(
    -180.0,
    180.0,
    "a longitude from -180 to 180 degrees, or an empty cell",
);
/// From below the Dead Sea (-430 m) to above any aircraft: a value in feet or in mm stands out.
pub(super) const AN_ALTITUDE: Range = range(
    -500.0,
    30_000.0,
    "an altitude above mean sea level from -500 to 30000 m, or an empty cell",
);
pub(super) const A_SPEED: Range = range(
    0.0,
    120.0,
    "a wind speed from 0 to 120 m/s, or an empty cell",
);
/// A turn more on either side: a vane may count on past north.
pub(super) const A_DIRECTION: Range = range(
    -360.0,
    720.0,
    "a direction from -360 to 720 degrees, or an empty cell",
);
pub(super) const A_TEMPERATURE: Range = range(
    -120.0,
    100.0,
    "a temperature from -120 to 100 degrees Celsius, or an empty cell",
);
pub(super) const A_HUMIDITY: Range = range(
    0.0,
    105.0,
    "a relative humidity from 0 to 105 % (a sensor may be off in fog), or an empty cell",
);
pub(super) const A_PRESSURE: Range = range(
    1.0,
    1200.0,
    "a pressure from 1 to 1200 hPa, or an empty cell",
);
/// A day: what is the mean of longer says nothing of a plume.
pub(super) const AN_AVERAGING: Range = range(
    0.0,
    86_400.0,
    "an averaging time from 0 to 86400 s, or an empty cell",
);
pub(super) const A_SPREAD: Range = range(
    f64::MIN_POSITIVE,
    MOST_READING_PPM,
    "a standard deviation above 0 and at most 2000000 ppm, or an empty cell",
);
