//! The world that a scenario describes: its frame, air, wind and plume model.

use crate::check::Refusal;
use crate::random::stream;
use crate::tables::{
    AirKind, HomeTable, MechanismTable, Scenario, SourceTable, USUAL_SLOW_TIME_S, VehicleKind,
};
use air::geo::{Enu, Geodetic, LocalFrame};
use air::isa::Atmosphere;
use air::wind::WindProfile;
use plume::{
    DispersionModel, DispersionSpec, PlumeError, SensorSpec, SourceSpec, Strength, UnsteadyAir,
    UnsteadySpec,
};

/// Homes that a scenario does not give lie in a row this far upwind of the site, m …
const HOME_UPWIND_M: f64 = 1100.0;
/// … beyond the keep-out, so that a landing stays out of it (its circle reaches 980 m downwind of
/// home), and this far from each other, m …
const HOME_SPACING_M: f64 = 60.0;
/// … in rows of at most so many, 7.7 km long, which leaves room for a landing at either end in a fence of 10 km; each row is
/// this far upwind of the one before, m: as far as vehicles with the same layer.
const HOMES_IN_ROW: usize = 130;
const ROW_SPACING_M: f64 = LAYER_SHARED_FROM_M;
/// Half side of the square fence of a scenario that gives none, m.
const DEFAULT_FENCE_M: f64 = 5000.0;
/// Vehicles are planned farther apart in height than they must stay, by how far they may be off
/// it, m.
pub const OFF_HEIGHT_M: f64 = 6.0;
/// Vehicles whose homes are this far from each other may have the same layer, m: two circles of the
/// Guardian (120 m) with the separation of 150 m between them.
const LAYER_SHARED_FROM_M: f64 = 400.0;
/// The lowest layer lies this far above the fence's floor, m.
const LOWEST_LAYER_M: f64 = 10.0;

/// Why a checked scenario still describes no world.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WorldError {
    /// The air.
    #[error(transparent)]
    Air(#[from] air::AirError),
    /// The plume, its sensor or a mechanism.
    #[error("{0}")]
    Plume(String),
    /// A mechanism of flight.
    #[error("{0}")]
    Flight(String),
}

impl From<PlumeError> for WorldError {
    fn from(error: PlumeError) -> Self {
        Self::Plume(error.to_string())
    }
}

/// The unsteady air of a scenario: who makes it twice has the same air twice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnsteadyWeather {
    spec: UnsteadySpec,
    seed: u64,
}

impl UnsteadyWeather {
    /// The air around the plume of `model`.
    pub fn around(&self, model: &DispersionModel) -> UnsteadyAir {
        let rng = |name| stream(self.seed, name);
        UnsteadyAir::new(model, self.spec, rng("air/eddies"), rng("air/fluctuation"))
    }
}

impl Scenario {
    /// The local frame around the site's origin.
    ///
    /// # Errors
    /// A site outside the frame's validity.
    pub fn frame(&self) -> Result<LocalFrame, WorldError> {
        Ok(LocalFrame::new(
            self.site.lat_deg,
            self.site.lon_deg,
            self.site.ground_amsl_m,
        )?)
    }

    /// The scenario's air where it is unsteady.
    pub fn unsteady_weather(&self) -> Option<UnsteadyWeather> {
        let w = &self.weather;
        (w.air == AirKind::Unsteady).then_some(UnsteadyWeather {
            spec: UnsteadySpec {
                meander_share: w.meander_share,
                lagrangian_time_s: w.lagrangian_time_s,
                fluctuation_intensity: w.fluctuation_intensity,
                fluctuation_time_s: w.fluctuation_time_s,
            },
            seed: self.mission.seed,
        })
    }

    /// Temperature and pressure with height, through those at the site's ground.
    ///
    /// # Errors
    /// Values outside the model's validity.
    pub fn atmosphere(&self) -> Result<Atmosphere, WorldError> {
        let ground = self.site.ground_amsl_m;
        let standard_hpa = Atmosphere::standard().at(ground).pressure_pa / 100.0;
        let pressure_hpa = self.weather.pressure_hpa.unwrap_or(standard_hpa);
        Ok(Atmosphere::through(
            ground,
            self.weather.temperature_c,
            pressure_hpa,
        )?)
    }

    /// Mean wind with height.
    ///
    /// # Errors
    /// Values outside the model's validity.
    pub fn wind_profile(&self) -> Result<WindProfile, WorldError> {
        let w = &self.weather;
        Ok(WindProfile::new(
            w.wind_speed_m_s,
            w.wind_height_agl_m,
            w.wind_from_deg,
            w.wind_exponent,
        )?)
    }

    /// Everything the plume model needs.
    ///
    /// # Errors
    /// Values outside the models' validity, or a mechanism that is not in the catalogue.
    pub fn dispersion_spec(&self) -> Result<DispersionSpec, WorldError> {
        let frame = self.frame()?;
        Ok(DispersionSpec {
            ground_amsl_m: self.site.ground_amsl_m,
            atmosphere: self.atmosphere()?,
            wind: self.wind_profile()?,
            stability: self.weather.stability,
            setting: self.weather.setting,
            ground_reflection: self.plume.ground_reflection,
            mixing_height_m: self.weather.mixing_height_m,
            lid_edge_m: 0.0,
            background_ppm: self.background.ppm(self.gas()),
            sources: self
                .sources
                .iter()
                .map(|s| source_spec(&frame, s))
                .collect::<Result<_, _>>()?,
            sigma_y_scale: self.plume.sigma_y_scale,
            sigma_z_scale: self.plume.sigma_z_scale,
            mechanisms: self.plume_mechanisms()?,
            sensor: self.sensor_spec(),
        })
    }

    /// The plume model ready for evaluation.
    ///
    /// # Errors
    /// As [`Scenario::dispersion_spec`].
    pub fn dispersion_model(&self) -> Result<DispersionModel, WorldError> {
        Ok(DispersionModel::new(self.dispersion_spec()?)?)
    }

    fn sensor_spec(&self) -> SensorSpec {
        let s = self.sensor();
        SensorSpec {
            time_constant_s: s.time_constant_s,
            noise_sd_ppm: s.noise_sd_ppm(self.gas()),
            slow_sd_ppm: s.slow_sd_ppm.unwrap_or_default(),
            slow_time_s: s.slow_time_s.unwrap_or(USUAL_SLOW_TIME_S),
            offset_ppm: s.offset_ppm,
            gain: s.gain,
            drift_ppm_per_h: s.drift_ppm_per_h,
            resolution_ppm: s.resolution_ppm,
            saturation_ppm: None,
        }
    }

    /// The scenario's extensions of world and sensor.
    ///
    /// # Errors
    /// A parameter that a mechanism does not have.
    fn plume_mechanisms(&self) -> Result<Vec<plume::Mechanism>, WorldError> {
        self.mechanisms
            .iter()
            .filter(|m| plume::MechanismId::from_name(&m.id).is_some())
            .map(MechanismTable::of_plume)
            .collect()
    }

    /// Take-off and landing point of the vehicle at `index` of the team.
    ///
    /// # Errors
    /// As [`Scenario::frame`].
    pub fn home(&self, index: usize) -> Result<Geodetic, WorldError> {
        if let Some(HomeTable { lat_deg, lon_deg }) = self.vehicles.get(index).and_then(|v| v.home)
        {
            return Ok(Geodetic { lat_deg, lon_deg });
        }
        let frame = self.frame()?;
        // Upwind of the stacks, out of the plume, so that a sensor settles on the background first.
        let upwind_deg = self.weather.wind_from_deg;
        let (row, place) = (index / HOMES_IN_ROW, index % HOMES_IN_ROW);
        let in_row = HOMES_IN_ROW.min(self.vehicles.len().saturating_sub(row * HOMES_IN_ROW));
        let abeam_m = (place as f64 - (in_row as f64 - 1.0) / 2.0) * HOME_SPACING_M;
        let row_m = HOME_UPWIND_M + row as f64 * ROW_SPACING_M;
        let at = Enu::default()
            .displaced(upwind_deg, self.fence.keep_out_radius_m + row_m)
            .displaced(upwind_deg + 90.0, abeam_m);
        Ok(frame.to_geodetic(at))
    }

    /// Height above which the fence ends everywhere, m above mean sea level.
    pub fn fence_top_amsl_m(&self) -> f64 {
        let fence = &self.fence;
        fence
            .top_amsl_m
            .unwrap_or(self.site.ground_amsl_m + fence.ceiling_agl_m)
    }

    /// Heights above mean sea level at which vehicles wait, from the lowest, m: apart by the
    /// separation and by what vehicles may be off their height.
    pub fn levels_amsl_m(&self) -> Vec<f64> {
        let fence = &self.fence;
        let lowest_m = (fence.floor_agl_m + LOWEST_LAYER_M).min(fence.ceiling_agl_m);
        // Two neighbours may be off towards each other, each by the whole tolerance.
        let step_m = fence.separation_height_m + 2.0 * OFF_HEIGHT_M;
        let above = ((fence.ceiling_agl_m - lowest_m) / step_m).floor() as usize;
        let ground_m = fence.home_ground_amsl_m.unwrap_or(self.site.ground_amsl_m);
        let level = |k: usize| ground_m + lowest_m + k as f64 * step_m;
        (0..=above).map(level).collect()
    }

    /// Heights above mean sea level that belong to one vehicle among its neighbours each, m, in
    /// the team's order: where it climbs after take-off and where its Guardian circles. The lowest
    /// are taken first, from the end of the team, and real vehicles have the highest. Where homes are
    /// far apart, or the band is too low for all neighbours, layers are used again.
    pub fn layers_amsl_m(&self) -> Vec<f64> {
        let (levels, homes) = (self.levels_amsl_m(), self.homes());
        let count = self.vehicles.len();
        let simulated = |k: usize| self.vehicles[k].kind == VehicleKind::Simulated;
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|&k| std::cmp::Reverse((simulated(k), k)));
        let mut taken: Vec<Option<usize>> = vec![None; count];
        for &k in &order {
            let near = |other: &usize| match (homes[k], homes[*other]) {
                (Some(a), Some(b)) => a.distance_m(b) < LAYER_SHARED_FROM_M,
                _ => true,
            };
            let mut used = vec![0; levels.len()];
            let others = (0..count).filter(near).filter_map(|other| taken[other]);
            others.for_each(|level| used[level] += 1);
            let highest_used = used.iter().rposition(|&n| n > 0);
            let above = highest_used.map_or(0, |level| level + 1);
            let first_free = (0..levels.len()).min_by_key(|&level| used[level]);
            let level = if !simulated(k) && above < levels.len() {
                above
            } else {
                first_free.unwrap_or(0)
            };
            taken[k] = Some(level);
        }
        taken
            .into_iter()
            .map(|level| levels[level.unwrap_or(0)])
            .collect()
    }

    /// Homes in the local frame; none where there is no frame.
    fn homes(&self) -> Vec<Option<Enu>> {
        let home = |k: usize| Some(self.frame().ok()?.to_enu(self.home(k).ok()?));
        (0..self.vehicles.len()).map(home).collect()
    }

    /// Corners of the fence in the local frame.
    ///
    /// # Errors
    /// As [`Scenario::frame`].
    pub fn fence_polygon(&self) -> Result<Vec<Enu>, WorldError> {
        let frame = self.frame()?;
        if self.fence.polygon.is_empty() {
            let d = DEFAULT_FENCE_M;
            let corner = |(east_m, north_m)| Enu { east_m, north_m };
            return Ok([(-d, -d), (d, -d), (d, d), (-d, d)].map(corner).to_vec());
        }
        let corner = |&[lat_deg, lon_deg]: &[f64; 2]| frame.to_enu(Geodetic { lat_deg, lon_deg });
        Ok(self.fence.polygon.iter().map(corner).collect())
    }

    /// The aircraft that the vehicle `id` really is: `airframe` with the scenario's mechanisms of
    /// flight.
    ///
    /// # Errors
    /// A mechanism that the flight model refuses.
    pub fn extend_aircraft(
        &self,
        id: &str,
        airframe: &fdm::Airframe,
    ) -> Result<fdm::Airframe, WorldError> {
        let mut mechanisms = Vec::new();
        for mechanism in &self.mechanisms {
            let mine =
                mechanism.platforms.is_empty() || mechanism.platforms.iter().any(|p| p == id);
            if mine && fdm::mechanism::spec(&mechanism.id).is_some() {
                mechanisms.push(mechanism.of_flight()?);
            }
        }
        let extended = airframe.clone().extended(mechanisms);
        extended.map_err(|e| WorldError::Flight(e.to_string()))
    }

    /// What only the models themselves can check; part of parsing.
    pub(crate) fn check_world(&self) -> Result<(), Refusal> {
        for (k, mechanism) in self.mechanisms.iter().enumerate() {
            let checked = if fdm::mechanism::spec(&mechanism.id).is_some() {
                mechanism.of_flight().map(|_| ())
            } else {
                mechanism.of_plume().map(|_| ())
            };
            checked.map_err(|e| {
                Refusal::new(
                    format!("mechanism.{k}"),
                    &mechanism.id,
                    format!("another: {e}"),
                )
            })?;
        }
        let refuse = |e: WorldError| Refusal::new("site", "this world", format!("another: {e}"));
        // What a file will say of an emission is checked when it is read.
        let mut known = self.clone();
        for source in &mut known.sources {
            if source.emission_series.take().is_some() {
                source.emission_kg_s.get_or_insert(0.0);
            }
        }
        let spec = known.dispersion_spec().map_err(refuse)?;
        DispersionModel::new(spec).map_err(|e| refuse(e.into()))?;
        Ok(())
    }
}

impl MechanismTable {
    fn of_plume(&self) -> Result<plume::Mechanism, WorldError> {
        let parameters = self.numbers()?;
        let named: Vec<(&str, f64)> = parameters.iter().map(|(n, v)| (n.as_str(), *v)).collect();
        Ok(plume::Mechanism::new(&self.id, &named)?.for_platforms(&self.platforms))
    }

    fn of_flight(&self) -> Result<fdm::mechanism::Mechanism, WorldError> {
        let mechanism = fdm::mechanism::Mechanism {
            id: self.id.clone(),
            parameters: self.numbers()?.into_iter().collect(),
        };
        mechanism
            .values()
            .map_err(|e| WorldError::Flight(e.to_string()))?;
        Ok(mechanism)
    }

    /// Its parameters as numbers.
    ///
    /// # Errors
    /// A parameter that is not a number.
    pub fn numbers(&self) -> Result<Vec<(String, f64)>, WorldError> {
        self.parameters
            .iter()
            .map(|(name, value)| {
                let number = value
                    .as_float()
                    .or_else(|| value.as_integer().map(|i| i as f64));
                number.map(|n| (name.clone(), n)).ok_or_else(|| {
                    WorldError::Plume(format!(
                        "mechanism {}: {name} = {value}; expected a number",
                        self.id
                    ))
                })
            })
            .collect()
    }
}

fn source_spec(frame: &LocalFrame, source: &SourceTable) -> Result<SourceSpec, WorldError> {
    if let Some(file) = &source.emission_series {
        return Err(WorldError::Plume(format!(
            "source {}: emission_series {file} has not been read",
            source.name
        )));
    }
    let strength = match (
        source.mean_emission_kg_s(),
        source.c_max_ppm,
        source.c_max_distance_m,
    ) {
        (None, Some(excess_ppm), Some(distance_m)) => Strength::CMax {
            excess_ppm,
            distance_m,
        },
        (emission, _, _) => Strength::EmissionKgS(emission.unwrap_or_default()),
    };
    Ok(SourceSpec {
        schedule: source.schedule()?,
        name: source.name.clone(),
        gas: source.gas,
        place: frame.to_enu(Geodetic {
            lat_deg: source.lat_deg,
            lon_deg: source.lon_deg,
        }),
        area: source.area(),
        stack_height_m: source.stack_height_m,
        effective_height_agl_m: source.axis_height_agl_m(),
        strength,
    })
}
