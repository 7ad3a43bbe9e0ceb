//! What a list of mechanisms does to the equations: sums of offsets, products of factors.

/// Seconds in an hour.
pub const HOUR_S: f64 = 3600.0;

/// A copy of the first source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SecondSource {
    /// Displacement from the first, m east.
    pub east_m: f64,
    /// Displacement from the first, m north.
    pub north_m: f64,
    /// Emission as a ratio to the first's.
    pub ratio: f64,
    /// Effective height above the first's, m.
    pub height_offset_m: f64,
}

/// The joint effect of the wind, spread, source and background mechanisms.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DispersionEffects {
    /// Added to the from-direction, degrees.
    pub direction_offset_deg: f64,
    /// Added to the from-direction per hour, degrees.
    pub direction_drift_deg_h: f64,
    /// Added to the from-direction per 100 m above the axis, degrees.
    pub veer_deg_100m: f64,
    /// Factor of the transport speed.
    pub speed_factor: f64,
    /// Variance of the axis direction, rad².
    pub meander_var_rad2: f64,
    /// Stability classes added.
    pub class_shift: f64,
    /// Factor of σy.
    pub sigma_y_factor: f64,
    /// Factor of σz.
    pub sigma_z_factor: f64,
    /// Exponent of distance in σz.
    pub sigma_z_exponent: f64,
    /// Added to σy² and σz², m².
    pub wake_var_m2: f64,
    /// Added to the effective height, m.
    pub height_offset_m: f64,
    /// Part that the ground sends back, added to the scenario's.
    pub ground_coefficient: f64,
    /// Height of the lid, m above ground; the lowest of several.
    pub lid_m: f64,
    /// Factor of the emission.
    pub emission_factor: f64,
    /// Growth rate of the emission, 1/h.
    pub emission_trend_h: f64,
    /// Added to the place of every source, m east.
    pub source_east_m: f64,
    /// Added to the place of every source, m north.
    pub source_north_m: f64,
    /// Decay rate, 1/s.
    pub decay_s: f64,
    /// Deposition velocity, m/s.
    pub deposition_m_s: f64,
    /// Added to the background, ppm.
    pub background_ppm: f64,
    /// Added to the background per hour, ppm.
    pub background_ppm_h: f64,
    /// Added to the background per metre east, ppm.
    pub background_east_ppm_m: f64,
    /// Added to the background per metre north, ppm.
    pub background_north_ppm_m: f64,
    /// Further sources.
    pub second_sources: Vec<SecondSource>,
}

impl DispersionEffects {
    /// No effect at all.
    pub(crate) fn none() -> Self {
        Self {
            direction_offset_deg: 0.0,
            direction_drift_deg_h: 0.0,
            veer_deg_100m: 0.0,
            speed_factor: 1.0,
            meander_var_rad2: 0.0,
            class_shift: 0.0,
            sigma_y_factor: 1.0,
            sigma_z_factor: 1.0,
            sigma_z_exponent: 0.0,
            wake_var_m2: 0.0,
            height_offset_m: 0.0,
            ground_coefficient: 0.0,
            lid_m: f64::INFINITY,
            emission_factor: 1.0,
            emission_trend_h: 0.0,
            source_east_m: 0.0,
            source_north_m: 0.0,
            decay_s: 0.0,
            deposition_m_s: 0.0,
            background_ppm: 0.0,
            background_ppm_h: 0.0,
            background_east_ppm_m: 0.0,
            background_north_ppm_m: 0.0,
            second_sources: Vec::new(),
        }
    }
}

/// The joint effect of the sensor mechanisms on one platform.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SensorEffects {
    /// Time constants of the lags in series, s.
    pub lags_s: Vec<f64>,
    /// Slope of the reading.
    pub gain: f64,
    /// Reading at zero concentration, ppm.
    pub offset_ppm: f64,
    /// Drift of the reading, ppm/s.
    pub drift_ppm_s: f64,
    /// No reading above this, ppm.
    pub limit_ppm: f64,
    /// Reading per % of relative humidity above the second number.
    pub humidity: [f64; 2],
    /// Reading per K of temperature above the second number (°C).
    pub temperature: [f64; 2],
    /// Reading per hPa of pressure above the second number.
    pub pressure: [f64; 2],
    /// Logged minus true time, s.
    pub clock_s: f64,
    /// Logged minus true position, m east, north, up.
    pub position_m: [f64; 3],
}

impl SensorEffects {
    /// No effect at all.
    pub(crate) fn none() -> Self {
        Self {
            lags_s: Vec::new(),
            gain: 1.0,
            offset_ppm: 0.0,
            drift_ppm_s: 0.0,
            limit_ppm: f64::INFINITY,
            humidity: [0.0; 2],
            temperature: [0.0; 2],
            pressure: [0.0; 2],
            clock_s: 0.0,
            position_m: [0.0; 3],
        }
    }

    /// What the air itself adds to the reading, ppm; a column that is not known adds nothing.
    pub(crate) fn cross_ppm(&self, air: &SensorAir) -> f64 {
        let term = |k: &[f64; 2], x: f64| {
            if k[0] == 0.0 || !x.is_finite() {
                0.0
            } else {
                k[0] * (x - k[1])
            }
        };
        term(&self.humidity, air.relative_humidity_pct)
            + term(&self.temperature, air.temperature_c)
            + term(&self.pressure, air.pressure_hpa)
    }
}

/// The air around a sensor as other sensors log it; not a number where not known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorAir {
    /// Air temperature, °C.
    pub temperature_c: f64,
    /// Relative humidity, %.
    pub relative_humidity_pct: f64,
    /// Static pressure, hPa.
    pub pressure_hpa: f64,
}

impl SensorAir {
    /// Nothing known.
    pub const UNKNOWN: Self = Self {
        temperature_c: f64::NAN,
        relative_humidity_pct: f64::NAN,
        pressure_hpa: f64::NAN,
    };
}
