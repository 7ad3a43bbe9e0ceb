//! What the columns of an observation file may hold.

/// What a cell of a column may hold.
#[derive(Clone, Copy)]
pub(super) struct Range {
    pub low: f64,
    pub high: f64,
    /// What would be right, in words.
    pub expected: &'static str,
}

pub(super) const A_NUMBER: Range = Range {
    low: f64::MIN,
    high: f64::MAX,
    expected: "a finite number with a decimal point, or nothing",
};
pub(super) const A_TIME: Range = Range {
    low: f64::MIN,
    high: f64::MAX,
    expected: "a time in seconds as a finite number with a decimal point",
};
pub(super) const A_LATITUDE: Range = Range {
    low: -90.0,
    high: 90.0,
    expected: "a latitude from -90 to 90 degrees, or nothing",
};
pub(super) const A_LONGITUDE: Range = Range {
    low: -180.0,
    high: 180.0,
    expected: "a longitude from -180 to 180 degrees, or nothing",
};
pub(super) const AN_ALTITUDE: Range = Range {
    low: -500.0,
    high: 30_000.0,
    expected: "an altitude above mean sea level from -500 to 30000 m, or nothing",
};
pub(super) const A_SPEED: Range = Range {
    low: 0.0,
    high: 120.0,
    expected: "a wind speed from 0 to 120 m/s, or nothing",
};
pub(super) const A_TEMPERATURE: Range = Range {
    low: -120.0,
    high: 100.0,
    expected: "a temperature from -120 to 100 degrees Celsius, or nothing",
};
pub(super) const A_HUMIDITY: Range = Range {
    low: -10.0,
    high: 120.0,
    expected: "a relative humidity from -10 (a sensor may be off) to 120 %, or nothing",
};
pub(super) const A_PRESSURE: Range = Range {
    low: 1.0,
    high: 1200.0,
    expected: "a pressure from 1 to 1200 hPa, or nothing",
};
pub(super) const A_SPREAD: Range = Range {
    low: f64::MIN_POSITIVE,
    high: f64::MAX,
    expected: "a standard deviation above 0 ppm, or nothing",
};
