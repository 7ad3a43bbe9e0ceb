//! The stand-in's own world: its wind with gusts, its air, its plume and its gas sensor.

use crate::config::StandInConfig;
use air::dryden::{Dryden, Turbulence};
use air::geo::{Enu, LocalFrame};
use air::isa::Air;
use air::terrain::Terrain;
use air::wind::{WindProfile, WindSeries, WindVector};
use fdm::{AirAround, FlightState};
use plume::effects::SensorAir;
use plume::sensor::Sensor;
use plume::{DispersionModel, Gas, Place, UnsteadyAir};
use rand::rngs::ChaCha8Rng;

/// Height at which MIL-F-8785C takes the wind that makes turbulence, m (20 ft).
const REFERENCE_HEIGHT_M: f64 = 6.096;
/// Vertical gust over wind at 20 ft in MIL-F-8785C.
const STANDARD_INTENSITY: f64 = 0.1;
/// Relative humidity of the stand-in's air, %.
pub(crate) const HUMIDITY_PCT: f64 = 70.0;

/// The world around one stand-in.
#[derive(Debug)]
pub(crate) struct Reality {
    pub model: DispersionModel,
    pub frame: LocalFrame,
    terrain: Terrain,
    /// The slow wind at the profile's reference height.
    slow: WindSeries,
    /// Whether it changes.
    slow_changes: bool,
    unsteady: Option<UnsteadyAir>,
    /// Scale of the standard's turbulence.
    turbulence_scale: f64,
    gust: Dryden,
    turbulence: Turbulence,
    profile: WindProfile,
    /// The wind without gusts, north, east and down, m/s.
    mean_ned_m_s: [f64; 3],
    air: Air,
    around: AirAround,
    sensor: Sensor,
}

impl Reality {
    /// The gas that its sensor reads.
    pub(crate) fn gas(&self) -> Gas {
        self.model.spec().sources[0].gas
    }

    /// The reality that a stand-in is made for.
    pub(crate) fn of(config: &StandInConfig) -> Self {
        let model = config.model.clone();
        let spec = model.spec();
        let air = spec.atmosphere.at(spec.ground_amsl_m);
        let constant = || WindSeries::constant(spec.wind.at(spec.wind.reference_height_agl_m()));
        Self {
            profile: spec.wind,
            mean_ned_m_s: [0.0; 3],
            slow_changes: config.wind_series.is_some(),
            slow: config.wind_series.clone().unwrap_or_else(constant),
            unsteady: config.unsteady.map(|u| u.around(&model)),
            turbulence: Turbulence::mil_f_8785c(0.0, 0.0, 0.0),
            sensor: Sensor::new(&spec.sensor, &spec.mechanisms, &config.platform),
            around: AirAround {
                wind_ned_m_s: [0.0; 3],
                density_kg_m3: air.density_kg_m3(),
            },
            air,
            frame: config.frame,
            terrain: config.terrain.clone(),
            turbulence_scale: config.turbulence_intensity / STANDARD_INTENSITY,
            gust: Dryden::new(),
            model,
        }
    }

    fn height_agl_m(&self, state: &FlightState) -> f64 {
        state.alt_amsl_m - self.model.spec().ground_amsl_m
    }

    /// Height of the ground below, m above mean sea level.
    pub(crate) fn ground_amsl_m(&self, state: &FlightState) -> f64 {
        self.ground_at_amsl_m(Enu::new(state.east_m, state.north_m))
    }

    /// Height of the ground at a place, m above mean sea level.
    pub(crate) fn ground_at_amsl_m(&self, at: Enu) -> f64 {
        match &self.terrain {
            Terrain::Flat(ground_amsl_m) => *ground_amsl_m,
            terrain => terrain.ground_amsl_m(self.frame.to_geodetic(at)),
        }
    }

    /// Equivalent over true airspeed in the air at the vehicle.
    pub(crate) fn eas_over_tas(&self) -> f64 {
        self.air.eas_over_tas()
    }

    /// What changes slowly: mean wind, turbulence and air at the vehicle's height.
    pub(crate) fn update_mean_air(&mut self, state: &FlightState, time_s: f64) {
        let height = (state.alt_amsl_m - self.ground_amsl_m(state)).max(0.0);
        let spec = self.model.spec();
        if self.slow_changes {
            let wind = self.slow.at(time_s);
            let reference_m = spec.wind.reference_height_agl_m();
            // A series was checked when it was read: its speeds make profiles.
            if let Ok(profile) = spec.wind.through(wind, reference_m) {
                self.profile = profile;
            }
        }
        let WindVector {
            east_m_s,
            north_m_s,
        } = self.profile.at(height);
        let eddies = self.unsteady.as_mut();
        let [east, north, up] = eddies.map_or([0.0; 3], |air| air.wind_m_s(time_s, height));
        self.mean_ned_m_s = [north_m_s + north, east_m_s + east, -up];
        // MIL-F-8785C scales low-altitude turbulence by the wind at 20 ft.
        let wind_20ft = self.profile.speed_at_m_s(REFERENCE_HEIGHT_M);
        self.turbulence = Turbulence::mil_f_8785c(height, wind_20ft, self.turbulence_scale);
        self.air = spec.atmosphere.at(state.alt_amsl_m);
    }

    /// The air around the vehicle over the next `dt_s`.
    pub(crate) fn step_gusts(
        &mut self,
        dt_s: f64,
        airspeed_m_s: f64,
        rng: &mut ChaCha8Rng,
    ) -> AirAround {
        let [along, right, down] = self.gust.step(dt_s, airspeed_m_s, &self.turbulence, rng);
        let [mean_north, mean_east, mean_down] = self.mean_ned_m_s;
        let speed = mean_north.hypot(mean_east);
        // Gusts come along and across the mean wind; in calm air any axes will do.
        let (north, east) = if speed > 0.0 {
            (mean_north / speed, mean_east / speed)
        } else {
            (1.0, 0.0)
        };
        self.around = AirAround {
            wind_ned_m_s: [
                mean_north + along * north - right * east,
                mean_east + along * east + right * north,
                mean_down + down,
            ],
            density_kg_m3: self.air.density_kg_m3(),
        };
        self.around
    }

    /// The air around the vehicle now.
    pub(crate) fn around(&self) -> AirAround {
        self.around
    }

    /// Temperature and pressure at the vehicle.
    pub(crate) fn air(&self) -> Air {
        self.air
    }

    /// What the gas sensor reads `dt_s` after its last reading, ppm.
    pub(crate) fn read_gas(
        &mut self,
        state: &FlightState,
        time_s: f64,
        dt_s: f64,
        rng: &mut ChaCha8Rng,
    ) -> f64 {
        let place = Place {
            east_m: state.east_m,
            north_m: state.north_m,
            height_agl_m: self.height_agl_m(state),
        };
        let true_ppm = self.true_ppm(&place, time_s);
        let ambient = SensorAir {
            temperature_c: self.air.temperature_k - air::isa::ZERO_CELSIUS_K,
            relative_humidity_pct: HUMIDITY_PCT,
            pressure_hpa: self.air.pressure_pa / 100.0,
        };
        self.sensor.read_in(true_ppm, &ambient, dt_s, rng)
    }

    /// Mole fraction at a place, ppm: of the mean plume where nothing moves it, and else of the one that
    /// the wind has carried so far.
    fn true_ppm(&mut self, place: &Place, time_s: f64) -> f64 {
        if !self.slow_changes && self.unsteady.is_none() {
            return self.model.mean_ppm(place, time_s);
        }
        let unsteady = self.unsteady.as_mut();
        let puffs = self.model.puffs(&self.slow, 0.0, unsteady, time_s);
        self.model.ppm_among(&puffs, place)
    }

    /// Place and time as the sensor's platform logs them, with the errors of its mechanisms.
    pub(crate) fn logged(&self, at: &Place, time_s: f64) -> (Place, f64) {
        (
            self.sensor.logged_place(at),
            self.sensor.logged_time_s(time_s),
        )
    }
}
