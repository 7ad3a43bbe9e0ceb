//! What a stand-in is made from.

use crate::error::StandInError;
use crate::parameters::AutopilotParameters;
use air::geo::{Geodetic, LocalFrame};
use air::terrain::Terrain;
use air::wind::WindSeries;
use fdm::Airframe;
use mav_bridge::signing::SigningConfig;
use plume::DispersionModel;
use scenario::Scenario;
use scenario::world::UnsteadyWeather;

/// Everything a stand-in is made from.
#[derive(Debug, Clone)]
pub struct StandInConfig {
    /// MAVLink system id, 1 to 254.
    pub system_id: u8,
    /// Name of the platform, for mechanisms that apply to one only.
    pub platform: String,
    /// The airframe.
    pub aircraft: Airframe,
    /// Its reality: wind, air, plume, sensor.
    pub model: DispersionModel,
    /// The site's local frame.
    pub frame: LocalFrame,
    /// Take-off and landing point.
    pub home: Geodetic,
    /// Ground there, m above mean sea level.
    pub home_amsl_m: f64,
    /// Heading of the launch, degrees; into the wind by default.
    pub launch_heading_deg: f64,
    /// Vertical gust over wind at 20 ft, 1 sigma; 0.1 is that of MIL-F-8785C.
    pub turbulence_intensity: f64,
    /// The ground of its reality.
    pub terrain: Terrain,
    /// Wind over time at the profile's height; none: the world's own, constant.
    pub wind_series: Option<WindSeries>,
    /// What meanders and fluctuates on top; none in steady air.
    pub unsteady: Option<UnsteadyWeather>,
    /// Settings as ArduPlane's.
    pub parameters: AutopilotParameters,
    /// Whether a landing sequence at home is on board.
    pub has_landing_sequence: bool,
    /// Key shared with the ground station; unsigned frames are then refused.
    pub signing: Option<SigningConfig>,
}

impl StandInConfig {
    /// The stand-in for the vehicle at `index` of the scenario's team, in the scenario's
    /// `[reality]`, whose mechanisms of flight change the aircraft. A wind series must be read
    /// and set by the caller.
    ///
    /// # Errors
    /// No such vehicle, or a reality outside the models' validity.
    pub fn from_scenario(
        scenario: &Scenario,
        index: usize,
        aircraft: Airframe,
    ) -> Result<Self, StandInError> {
        let vehicle = scenario
            .vehicles
            .get(index)
            .ok_or(StandInError::NoVehicle(index))?;
        let refuse = |e: scenario::world::WorldError| StandInError::Reality(e.to_string());
        // The aircraft stands where the team believes its home to be.
        let home = scenario.home(index).map_err(refuse)?;
        let reality = scenario.in_reality();
        let aircraft = reality
            .extend_aircraft(&vehicle.id, &aircraft)
            .map_err(refuse)?;
        let model = reality.dispersion_model().map_err(refuse)?;
        let home_amsl_m = reality.site.ground_amsl_m;
        let eas_over_tas = model.spec().atmosphere.at(home_amsl_m).eas_over_tas();
        let speeds = aircraft.speeds();
        Ok(Self {
            system_id: u8::try_from(index + 1).unwrap_or(1),
            platform: vehicle.id.clone(),
            frame: reality.frame().map_err(refuse)?,
            home,
            home_amsl_m,
            launch_heading_deg: reality.weather.wind_from_deg,
            turbulence_intensity: reality.weather.turbulence_intensity,
            terrain: Terrain::Flat(home_amsl_m),
            wind_series: None,
            unsteady: reality.unsteady_weather(),
            parameters: if aircraft.hovers() {
                AutopilotParameters::of_multirotor()
            } else {
                AutopilotParameters::new(
                    speeds.min_m_s * eas_over_tas,
                    speeds.max_m_s * eas_over_tas,
                    aircraft.loiter_radius_m(),
                )
            },
            has_landing_sequence: !aircraft.hovers(),
            signing: None,
            aircraft,
            model,
        })
    }

    /// The same stand-in over `terrain`, on which it then stands at home.
    #[must_use]
    pub fn over(self, terrain: Terrain) -> Self {
        Self {
            home_amsl_m: terrain.ground_amsl_m(self.home),
            terrain,
            ..self
        }
    }
}
