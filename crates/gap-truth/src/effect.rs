//! What can be hidden in a case: the mechanisms of the contract's catalogue, and kinds that it
//! does not contain.

use crate::scene::Need;
use serde::{Deserialize, Serialize};

/// An effect with its name in files or, outside the catalogue, in tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are the contract's mechanism ids")]
pub enum PlumeEffect {
    WindDirectionOffset,
    WindDirectionDrift,
    WindSpeedScale,
    WindVeerWithHeight,
    Meander,
    StabilityClass,
    SigmaYScale,
    SigmaZScale,
    SigmaZGrowth,
    EffectiveHeightOffset,
    GroundReflection,
    MixingLid,
    EmissionScale,
    EmissionTrend,
    SecondSource,
    SourcePositionOffset,
    FirstOrderDecay,
    DryDeposition,
    BuildingDownwash,
    BackgroundOffset,
    BackgroundDrift,
    BackgroundGradient,
    SensorLag,
    SensorGain,
    SensorOffset,
    SensorDrift,
    SensorSaturation,
    CrossSensitivityHumidity,
    CrossSensitivityTemperature,
    CrossSensitivityPressure,
    ClockOffset,
    PositionOffset,
    AltitudeOffset,
    /// Outside: excess made and lost again on the way (a chemistry with a hump in travel time).
    UnlistedChemistry,
    /// Outside: a tall obstacle thins the plume in its lee.
    ObstacleWake,
    /// Outside: one platform switches between two sensors, the second with a dead time.
    SecondSensorDeadTime,
    /// Outside: a slow swing of the transport that no log shows.
    SlowSwing,
    /// Outside: a wavy background in time.
    BackgroundWaves,
    /// Outside: a layer of other air in a band of heights.
    BackgroundLayer,
    /// Outside: the source pulses.
    PulsingSource,
    /// Outside: one sensor's zero waves.
    SensorWaves,
    /// Outside: the source is on and off by turns.
    OnOffEmission,
    /// Outside, a reality of another form: both spreads grow otherwise with distance.
    SpreadGrowth,
    /// Outside, a reality of another form: the plume is not normal across.
    SkewedProfile,
    /// Outside, a reality of another form: the axis wanders by 4 degrees with a memory of a minute, and
    /// the plume is intermittent.
    AxisWander,
    /// Outside, a reality of another form: the transport swings by 30 degrees within the record.
    WideSwing,
}

use PlumeEffect as E;

/// The effects of the catalogue.
pub const CATALOGUE: [PlumeEffect; 33] = [
    E::WindDirectionOffset,
    E::WindDirectionDrift,
    E::WindSpeedScale,
    E::WindVeerWithHeight,
    E::Meander,
    E::StabilityClass,
    E::SigmaYScale,
    E::SigmaZScale,
    E::SigmaZGrowth,
    E::EffectiveHeightOffset,
    E::GroundReflection,
    E::MixingLid,
    E::EmissionScale,
    E::EmissionTrend,
    E::SecondSource,
    E::SourcePositionOffset,
    E::FirstOrderDecay,
    E::DryDeposition,
    E::BuildingDownwash,
    E::BackgroundOffset,
    E::BackgroundDrift,
    E::BackgroundGradient,
    E::SensorLag,
    E::SensorGain,
    E::SensorOffset,
    E::SensorDrift,
    E::SensorSaturation,
    E::CrossSensitivityHumidity,
    E::CrossSensitivityTemperature,
    E::CrossSensitivityPressure,
    E::ClockOffset,
    E::PositionOffset,
    E::AltitudeOffset,
];

/// The effects outside the catalogue.
pub const OUTSIDE: [PlumeEffect; 13] = [
    E::UnlistedChemistry,
    E::ObstacleWake,
    E::SecondSensorDeadTime,
    E::SlowSwing,
    E::BackgroundWaves,
    E::BackgroundLayer,
    E::PulsingSource,
    E::SensorWaves,
    E::OnOffEmission,
    E::SpreadGrowth,
    E::SkewedProfile,
    E::AxisWander,
    E::WideSwing,
];

impl PlumeEffect {
    /// The contract's id, or a name for tables.
    pub fn id(self) -> &'static str {
        match self {
            E::WindDirectionOffset => "wind-direction-offset",
            E::WindDirectionDrift => "wind-direction-drift",
            E::WindSpeedScale => "wind-speed-scale",
            E::WindVeerWithHeight => "wind-veer-with-height",
            E::Meander => "meander",
            E::StabilityClass => "stability-class",
            E::SigmaYScale => "sigma-y-scale",
            E::SigmaZScale => "sigma-z-scale",
            E::SigmaZGrowth => "sigma-z-growth",
            E::EffectiveHeightOffset => "effective-height-offset",
            E::GroundReflection => "ground-reflection",
            E::MixingLid => "mixing-lid",
            E::EmissionScale => "emission-scale",
            E::EmissionTrend => "emission-trend",
            E::SecondSource => "second-source",
            E::SourcePositionOffset => "source-position-offset",
            E::FirstOrderDecay => "first-order-decay",
            E::DryDeposition => "dry-deposition",
            E::BuildingDownwash => "building-downwash",
            E::BackgroundOffset => "background-offset",
            E::BackgroundDrift => "background-drift",
            E::BackgroundGradient => "background-gradient",
            E::SensorLag => "sensor-lag",
            E::SensorGain => "sensor-gain",
            E::SensorOffset => "sensor-offset",
            E::SensorDrift => "sensor-drift",
            E::SensorSaturation => "sensor-saturation",
            E::CrossSensitivityHumidity => "cross-sensitivity-humidity",
            E::CrossSensitivityTemperature => "cross-sensitivity-temperature",
            E::CrossSensitivityPressure => "cross-sensitivity-pressure",
            E::ClockOffset => "clock-offset",
            E::PositionOffset => "position-offset",
            E::AltitudeOffset => "altitude-offset",
            E::UnlistedChemistry => "unlisted-chemistry",
            E::ObstacleWake => "obstacle-wake",
            E::SecondSensorDeadTime => "second-sensor-dead-time",
            E::SlowSwing => "slow-swing",
            E::BackgroundWaves => "background-waves",
            E::BackgroundLayer => "background-layer",
            E::PulsingSource => "pulsing-source",
            E::SensorWaves => "sensor-waves",
            E::OnOffEmission => "on-off-emission",
            E::SpreadGrowth => "spread-growth",
            E::SkewedProfile => "skewed-profile",
            E::AxisWander => "axis-wander",
            E::WideSwing => "wide-swing",
        }
    }

    /// Whether the contract's catalogue has it.
    pub fn in_catalogue(self) -> bool {
        self <= E::AltitudeOffset
    }

    /// What a scene must offer for it to show.
    pub fn need(self) -> Need {
        match self {
            E::GroundReflection | E::DryDeposition | E::MixingLid => Need::LowPlume,
            E::SigmaZGrowth | E::FirstOrderDecay | E::BuildingDownwash | E::Meander => {
                Need::Distances
            }
            E::UnlistedChemistry | E::StabilityClass => Need::Distances,
            E::WindVeerWithHeight => Need::Heights,
            // A swing of a wind that nobody logged is no finding.
            E::SlowSwing | E::AxisWander | E::WideSwing => Need::WindLog,
            E::SpreadGrowth => Need::Distances,
            _ => Need::Any,
        }
    }

    /// Whether it is a world of another form, as strong as such worlds are at strength 1, rather than an
    /// effect that may be of any size.
    pub fn is_a_reality(self) -> bool {
        self >= E::SpreadGrowth
    }

    /// Whether one platform alone may have it.
    pub fn of_a_platform(self) -> bool {
        (E::SensorLag..=E::AltitudeOffset).contains(&self)
            || matches!(self, E::SecondSensorDeadTime | E::SensorWaves)
    }

    /// Effects that no data of this kind tell from it, when it acts on all platforms or on one
    /// alone: a set with them is as good as one name. Emission and wind speed enter as a ratio; a
    /// level of the sensors of a whole team is a level of the air; a shift of all logged places is
    /// one of the source.
    pub fn inseparable_from(self, of_all: bool) -> &'static [PlumeEffect] {
        match self {
            // Strength, dilution and the gain of all sensors about the background are one factor;
            // a gain about zero is an offset of the background it acts on.
            E::EmissionScale => &[E::WindSpeedScale, E::SensorGain],
            E::WindSpeedScale => &[E::EmissionScale, E::SensorGain],
            E::SensorGain if of_all => &[
                E::EmissionScale,
                E::WindSpeedScale,
                E::SensorOffset,
                E::BackgroundOffset,
            ],
            E::SensorGain => &[E::SensorOffset],
            E::BackgroundOffset => &[E::SensorOffset, E::SensorGain],
            E::BackgroundDrift => &[E::SensorDrift],
            E::SourcePositionOffset => &[E::PositionOffset],
            E::EffectiveHeightOffset => &[E::AltitudeOffset],
            E::SensorOffset if of_all => &[E::BackgroundOffset, E::SensorGain],
            E::SensorOffset => &[E::SensorGain],
            E::SensorDrift if of_all => &[E::BackgroundDrift],
            // Worlds of another form that the catalogue has a word for all the same.
            E::AxisWander => &[E::Meander],
            E::WideSwing => &[E::WindDirectionDrift, E::WindDirectionOffset],
            E::PositionOffset if of_all => &[E::SourcePositionOffset],
            E::AltitudeOffset if of_all => &[E::EffectiveHeightOffset],
            _ => &[],
        }
    }

    /// Coordinates in which an effect outside the catalogue may rightly be said to live.
    pub fn coordinates(self) -> &'static [&'static str] {
        match self {
            E::UnlistedChemistry => &["along_wind"],
            E::ObstacleWake => &["map", "along_wind", "across_wind"],
            E::SecondSensorDeadTime => &["platform"],
            E::SlowSwing => &["time", "across_wind"],
            E::BackgroundWaves => &["time"],
            E::BackgroundLayer => &["height"],
            E::PulsingSource => &["time", "along_wind"],
            E::SensorWaves => &["platform"],
            E::OnOffEmission => &["time", "along_wind"],
            E::SpreadGrowth => &["along_wind", "across_wind", "height"],
            E::SkewedProfile => &["across_wind", "map"],
            E::AxisWander | E::WideSwing => &["time", "across_wind"],
            _ => &[],
        }
    }
}

impl std::fmt::Display for PlumeEffect {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.id())
    }
}
