//! The catalogue itself: one entry a mechanism.

use super::Coordinate::{Linear, Log};
use super::Family::{Background, Sensor, Source, Spread, Wind};
use super::{Coordinate, Family, MechanismId, MechanismSpec, ParameterSpec};

/// Every mechanism of the plume, source, background and sensor families, in the order of
/// [`MechanismId::ALL`].
pub fn catalogue() -> &'static [MechanismSpec] {
    CATALOGUE
}

/// A fitted parameter whose neutral value is zero.
const fn offset(
    name: &'static str,
    unit: &'static str,
    prior_sd: f64,
    low: f64,
    high: f64,
) -> ParameterSpec {
    ParameterSpec {
        name,
        unit,
        neutral: 0.0,
        prior_centre: 0.0,
        prior_sd,
        low,
        high,
        coordinate: Linear,
        default: None,
    }
}

/// A fitted factor.
const fn factor(name: &'static str, prior_sd: f64, low: f64, high: f64) -> ParameterSpec {
    ParameterSpec {
        neutral: 1.0,
        prior_centre: 1.0,
        coordinate: Log,
        ..offset(name, "1", prior_sd, low, high)
    }
}

/// A fitted limit, which does nothing when infinite.
const fn limit(
    name: &'static str,
    unit: &'static str,
    centre: f64,
    low: f64,
    high: f64,
) -> ParameterSpec {
    ParameterSpec {
        neutral: f64::INFINITY,
        prior_centre: centre,
        coordinate: Log as Coordinate,
        ..offset(name, unit, 1.0, low, high)
    }
}

/// A setting that is not fitted.
const fn setting(
    name: &'static str,
    unit: &'static str,
    default: f64,
    low: f64,
    high: f64,
) -> ParameterSpec {
    ParameterSpec {
        neutral: default,
        prior_centre: default,
        default: Some(default),
        ..offset(name, unit, 1.0, low, high)
    }
}

const fn entry(
    id: MechanismId,
    family: Family,
    parameters: &'static [ParameterSpec],
    sign: &'static str,
) -> MechanismSpec {
    MechanismSpec {
        id,
        family,
        parameters,
        sign,
    }
}

use MechanismId as M;

static CATALOGUE: &[MechanismSpec] = &[
    entry(
        M::WindDirectionOffset,
        Wind,
        &[offset("offset_deg", "deg", 10.0, -180.0, 180.0)],
        "added to the logged (or the scenario's) from-direction to get that of the transport",
    ),
    entry(
        M::WindDirectionDrift,
        Wind,
        &[offset("rate_deg_per_h", "deg/h", 20.0, -720.0, 720.0)],
        "added to the from-direction: rate times hours since time 0",
    ),
    entry(
        M::WindSpeedScale,
        Wind,
        &[factor("factor", 0.25, 0.05, 20.0)],
        "transport speed = factor times the logged (or the scenario's) speed",
    ),
    entry(
        M::WindVeerWithHeight,
        Wind,
        &[offset("rate_deg_per_100m", "deg/100 m", 5.0, -60.0, 60.0)],
        "added to the from-direction: rate times height above the plume axis; positive turns clockwise with height",
    ),
    entry(
        M::Meander,
        Wind,
        &[offset("sigma_deg", "deg", 5.0, 0.0, 45.0)],
        "standard deviation of the axis direction about the one used: sigma_y^2 grows by (x sigma)^2",
    ),
    entry(
        M::StabilityClass,
        Spread,
        &[offset("shift", "classes", 1.0, -5.0, 5.0)],
        "classes added to the scenario's, A to F; positive is more stable",
    ),
    entry(
        M::SigmaYScale,
        Spread,
        &[factor("factor", 0.35, 0.05, 20.0)],
        "sigma_y = factor times Briggs' sigma_y",
    ),
    entry(
        M::SigmaZScale,
        Spread,
        &[factor("factor", 0.35, 0.05, 20.0)],
        "sigma_z = factor times Briggs' sigma_z",
    ),
    entry(
        M::SigmaZGrowth,
        Spread,
        &[offset("exponent", "1", 0.3, -1.5, 1.5)],
        "sigma_z times (x / 1000 m)^exponent",
    ),
    entry(
        M::EffectiveHeightOffset,
        Spread,
        &[offset("offset_m", "m", 50.0, -1000.0, 1000.0)],
        "added to the effective height H of every source",
    ),
    entry(
        M::GroundReflection,
        Spread,
        &[offset("coefficient", "1", 1.0, 0.0, 1.0)],
        "part of the plume that the ground sends back: 0 none, 1 all",
    ),
    entry(
        M::MixingLid,
        Spread,
        &[limit("height_m", "m AGL", 700.0, 10.0, 10_000.0)],
        "height above ground of a lid that sends the plume back; none above it, and no effect on a plume above the lid",
    ),
    entry(
        M::EmissionScale,
        Source,
        &[factor("factor", 0.5, 0.01, 100.0)],
        "emission (or c_max) of every source times factor",
    ),
    entry(
        M::EmissionTrend,
        Source,
        &[offset("rate_per_h", "1/h", 1.0, -50.0, 50.0)],
        "emission times exp(rate times hours since time 0), of the time when the air passed the source",
    ),
    entry(
        M::SecondSource,
        Source,
        &[
            offset("east_m", "m", 1000.0, -20_000.0, 20_000.0),
            offset("north_m", "m", 1000.0, -20_000.0, 20_000.0),
            offset("ratio", "1", 0.5, 0.0, 50.0),
            setting("height_offset_m", "m", 0.0, -1000.0, 1000.0),
        ],
        "a copy of the first source: displacement east and north, emission as a ratio to the first, effective height above the first's",
    ),
    entry(
        M::SourcePositionOffset,
        Source,
        &[
            offset("east_m", "m", 100.0, -5000.0, 5000.0),
            offset("north_m", "m", 100.0, -5000.0, 5000.0),
        ],
        "added to the place of every source",
    ),
    entry(
        M::FirstOrderDecay,
        Source,
        &[offset("rate_per_s", "1/s", 5e-4, 0.0, 0.1)],
        "excess times exp(-rate times travel time)",
    ),
    entry(
        M::DryDeposition,
        Source,
        &[offset("velocity_m_s", "m/s", 0.15, 0.0, 5.0)],
        "deposition velocity at the ground, positive for a loss (source depletion)",
    ),
    entry(
        M::BuildingDownwash,
        Source,
        &[offset("area_m2", "m2", 5000.0, 0.0, 1e6)],
        "frontal area A of the building: sigma_y^2 and sigma_z^2 grow by A / (2 pi)",
    ),
    entry(
        M::BackgroundOffset,
        Background,
        &[offset("offset_ppm", "ppm", 10.0, -1e4, 1e4)],
        "added to the scenario's background",
    ),
    entry(
        M::BackgroundDrift,
        Background,
        &[offset("rate_ppm_per_h", "ppm/h", 20.0, -1e4, 1e4)],
        "added to the background: rate times hours since time 0",
    ),
    entry(
        M::BackgroundGradient,
        Background,
        &[
            offset("east_ppm_per_km", "ppm/km", 3.0, -1e3, 1e3),
            offset("north_ppm_per_km", "ppm/km", 3.0, -1e3, 1e3),
        ],
        "added to the background: gradient times distance east and north of the site's origin",
    ),
    entry(
        M::SensorLag,
        Sensor,
        &[offset("time_constant_s", "s", 8.0, 0.0, 600.0)],
        "first-order time constant, in series with the sensor's own",
    ),
    entry(
        M::SensorGain,
        Sensor,
        &[
            factor("factor", 0.2, 0.01, 100.0),
            setting("pivot_ppm", "ppm", 0.0, -1e5, 1e6),
        ],
        "reading = pivot + factor times (concentration - pivot)",
    ),
    entry(
        M::SensorOffset,
        Sensor,
        &[offset("offset_ppm", "ppm", 10.0, -1e4, 1e4)],
        "added to the reading",
    ),
    entry(
        M::SensorDrift,
        Sensor,
        &[offset("rate_ppm_per_h", "ppm/h", 20.0, -1e4, 1e4)],
        "added to the reading: rate times hours since time 0",
    ),
    entry(
        M::SensorSaturation,
        Sensor,
        &[limit("limit_ppm", "ppm", 800.0, 1.0, 1e6)],
        "no reading above this limit",
    ),
    entry(
        M::CrossSensitivityHumidity,
        Sensor,
        &[
            offset("ppm_per_percent", "ppm/%", 0.5, -100.0, 100.0),
            setting("reference_percent", "%", 50.0, 0.0, 100.0),
        ],
        "added to the reading: coefficient times (relative humidity - reference)",
    ),
    entry(
        M::CrossSensitivityTemperature,
        Sensor,
        &[
            offset("ppm_per_k", "ppm/K", 1.0, -100.0, 100.0),
            setting("reference_c", "deg C", 15.0, -60.0, 60.0),
        ],
        "added to the reading: coefficient times (air temperature - reference)",
    ),
    entry(
        M::CrossSensitivityPressure,
        Sensor,
        &[
            offset("ppm_per_hpa", "ppm/hPa", 0.5, -100.0, 100.0),
            setting("reference_hpa", "hPa", 1013.25, 100.0, 1100.0),
        ],
        "added to the reading: coefficient times (pressure - reference)",
    ),
    entry(
        M::ClockOffset,
        Sensor,
        &[offset("offset_s", "s", 5.0, -600.0, 600.0)],
        "logged time of a reading = true time + offset, against the clock of the positions",
    ),
    entry(
        M::PositionOffset,
        Sensor,
        &[
            offset("east_m", "m", 20.0, -5000.0, 5000.0),
            offset("north_m", "m", 20.0, -5000.0, 5000.0),
        ],
        "logged position = true position + offset",
    ),
    entry(
        M::AltitudeOffset,
        Sensor,
        &[offset("offset_m", "m", 20.0, -1000.0, 1000.0)],
        "logged altitude = true altitude + offset",
    ),
];
