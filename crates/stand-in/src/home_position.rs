//! Where a vehicle takes off and comes home to.

use crate::config::StandInConfig;
use air::geo::Enu;

/// Where it took off and comes home to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HomePosition {
    pub at: Enu,
    pub ground_amsl_m: f64,
    pub heading_deg: f64,
}

impl HomePosition {
    pub(crate) fn of(config: &StandInConfig) -> Self {
        Self {
            at: config.frame.to_enu(config.home),
            ground_amsl_m: config.home_amsl_m,
            heading_deg: config.launch_heading_deg,
        }
    }
}
