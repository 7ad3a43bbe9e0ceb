//! The plume's axis at the time of the next flight, and places by it.

use ::plume::effects::HOUR_S;
use ::plume::field::{Place, Transport};
use ::plume::mechanism::MechanismId;
use air::geo::Enu;
use infer::FittedSet;

use super::super::Study;
use super::super::data::{Setup, mean_transport};
use super::super::model::PlumeModel;

/// Where the plume lies and what carries it.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlumeAxis {
    pub towards_deg: f64,
    pub height_agl_m: f64,
    /// The wind as it is logged, or the scenario's, at the axis.
    pub wind: Transport,
}

impl PlumeAxis {
    /// As a set has it at `time_s` if the wind stays what it was in the mean.
    pub fn of(study: &Study<'_>, found: &FittedSet<PlumeModel<'_>>, time_s: f64) -> Self {
        let wind = mean_transport(
            found.model.track().transport(),
            &vec![1.0; study.data.len()],
        );
        let parts = found.model.parts(found.at());
        let sum = |id: MechanismId| {
            let own = parts.iter().filter(|p| p.id == id);
            own.map(|p| p.values[0]).sum::<f64>()
        };
        let turned_deg = sum(MechanismId::WindDirectionOffset)
            + sum(MechanismId::WindDirectionDrift) * time_s / HOUR_S;
        let stated_m = study.setup.base.sources[0].effective_height_agl_m;
        Self {
            towards_deg: wind.east.atan2(wind.north).to_degrees() + turned_deg,
            height_agl_m: stated_m + sum(MechanismId::EffectiveHeightOffset),
            wind,
        }
    }

    /// The place of a point along and across the wind, in m from the source, at a height above ground.
    pub fn place(&self, setup: &Setup, [along_m, across_m, height_agl_m]: [f64; 3]) -> Place {
        let source = setup.base.sources[0].place;
        let at = Enu {
            east_m: source.east_m,
            north_m: source.north_m,
        }
        .displaced(self.towards_deg, along_m)
        .displaced(self.towards_deg + 90.0, across_m);
        Place {
            east_m: at.east_m,
            north_m: at.north_m,
            height_agl_m,
        }
    }
}
