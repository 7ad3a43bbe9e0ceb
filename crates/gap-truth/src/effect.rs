//! What can be hidden in a case: the mechanisms of the contract's catalogue, and kinds that it
//! does not contain.

use crate::effect_list::effects;
use crate::scene::Need;
use serde::{Deserialize, Serialize};

effects! {
    /// An effect with its name in files or, outside the catalogue, in tables.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
    #[expect(missing_docs, reason = "the names are the contract's mechanism ids")]
    enum PlumeEffect;
    /// The effects of the catalogue.
    CATALOGUE: [
        WindDirectionOffset = "wind-direction-offset",
        WindDirectionDrift = "wind-direction-drift",
        WindSpeedScale = "wind-speed-scale",
        WindVeerWithHeight = "wind-veer-with-height",
        Meander = "meander",
        StabilityClass = "stability-class",
        SigmaYScale = "sigma-y-scale",
        SigmaZScale = "sigma-z-scale",
        SigmaZGrowth = "sigma-z-growth",
        EffectiveHeightOffset = "effective-height-offset",
        GroundReflection = "ground-reflection",
        MixingLid = "mixing-lid",
        EmissionScale = "emission-scale",
        EmissionTrend = "emission-trend",
        SecondSource = "second-source",
        SourcePositionOffset = "source-position-offset",
        FirstOrderDecay = "first-order-decay",
        DryDeposition = "dry-deposition",
        BuildingDownwash = "building-downwash",
        BackgroundOffset = "background-offset",
        BackgroundDrift = "background-drift",
        BackgroundGradient = "background-gradient",
        SensorLag = "sensor-lag",
        SensorGain = "sensor-gain",
        SensorOffset = "sensor-offset",
        SensorDrift = "sensor-drift",
        SensorSaturation = "sensor-saturation",
        CrossSensitivityHumidity = "cross-sensitivity-humidity",
        CrossSensitivityTemperature = "cross-sensitivity-temperature",
        CrossSensitivityPressure = "cross-sensitivity-pressure",
        ClockOffset = "clock-offset",
        PositionOffset = "position-offset",
        AltitudeOffset = "altitude-offset",
    ]
    /// The effects outside the catalogue.
    OUTSIDE: [
        /// Outside: excess made and lost again on the way (a chemistry with a hump in travel time).
        UnlistedChemistry = "unlisted-chemistry",
        /// Outside: a tall obstacle thins the plume in its lee.
        ObstacleWake = "obstacle-wake",
        /// Outside: one platform switches between two sensors, the second with a dead time.
        SecondSensorDeadTime = "second-sensor-dead-time",
        /// Outside: a slow swing of the transport that no log shows.
        SlowSwing = "slow-swing",
        /// Outside: a wavy background in time.
        BackgroundWaves = "background-waves",
        /// Outside: a layer of other air in a band of heights.
        BackgroundLayer = "background-layer",
        /// Outside: the source pulses.
        PulsingSource = "pulsing-source",
        /// Outside: one sensor's zero waves.
        SensorWaves = "sensor-waves",
        /// Outside: the source is on and off by turns.
        OnOffEmission = "on-off-emission",
        /// Outside, a reality of another form: both spreads grow otherwise with distance.
        SpreadGrowth = "spread-growth",
        /// Outside, a reality of another form: the plume is not normal across.
        SkewedProfile = "skewed-profile",
        /// Outside, a reality of another form: the axis wanders by 4 degrees with a memory of a minute, and
        /// the plume is intermittent.
        AxisWander = "axis-wander",
        /// Outside, a reality of another form: the transport swings by 30 degrees within the record.
        WideSwing = "wide-swing",
    ]
}

use PlumeEffect as E;

impl PlumeEffect {
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
