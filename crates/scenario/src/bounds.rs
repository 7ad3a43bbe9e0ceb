//! Where one vehicle of the team may be: its fence, its height band and its home. What the vehicle itself, the last
//! line of defence, and who answers a ground station in its name hold a place against.

use crate::Scenario;
use crate::world::WorldError;
use air::area;
use air::geo::{Enu, Geodetic, LocalFrame};

/// Distance from home within which a vehicle is never outside its fence, m: it may have to take
/// off and land beyond it.
const HOME_M: f64 = 500.0;
/// Height above the ceiling at which the fence is broken, m: setpoints reach up to the ceiling.
const ABOVE_CEILING_M: f64 = 30.0;
/// Depth below the floor at which a vehicle does not go, m: setpoints reach down to the floor.
const BELOW_FLOOR_M: f64 = 30.0;
/// Distance beyond the edge at which a place counts as outside, m: rounding of degrees.
const ROUNDING_M: f64 = 1.0;

/// Where one vehicle may be.
#[derive(Debug, Clone)]
pub struct Bounds {
    frame: LocalFrame,
    home: Enu,
    fence: Vec<Enu>,
    ceiling_amsl_m: f64,
    /// None where it follows a terrain, which only the squadron controller has.
    floor_amsl_m: Option<f64>,
}

impl Bounds {
    /// Those of the vehicle at `index` of the scenario's team.
    ///
    /// # Errors
    /// No such vehicle, or a site outside the frame's validity.
    pub fn of(scenario: &Scenario, index: usize) -> Result<Self, WorldError> {
        let frame = scenario.frame()?;
        let floor_m = scenario.site.ground_amsl_m + scenario.fence.floor_agl_m;
        Ok(Self {
            home: frame.to_enu(scenario.home(index)?),
            fence: scenario.fence_polygon()?,
            ceiling_amsl_m: scenario.fence_top_amsl_m(),
            floor_amsl_m: (!scenario.fence.follows_terrain).then_some(floor_m),
            frame,
        })
    }

    /// The site's frame.
    pub fn frame(&self) -> &LocalFrame {
        &self.frame
    }

    /// Why the vehicle does not go to a place, whoever sends it there; nothing where it may. Near home the height alone
    /// counts, as it has to take off and land there.
    pub fn refuses(&self, to: Geodetic, alt_amsl_m: f64) -> Option<String> {
        if ![to.lat_deg, to.lon_deg, alt_amsl_m]
            .iter()
            .all(|v| v.is_finite())
        {
            return Some("the place is not a finite number".to_owned());
        }
        let at = self.frame.to_enu(to);
        let near_home = at.distance_m(self.home) <= HOME_M;
        let beyond_m = -area::clearance_m(&self.fence, at);
        if !near_home && (beyond_m.is_nan() || beyond_m > ROUNDING_M) {
            return Some(format!("it is {beyond_m:.0} m outside the fence"));
        }
        let (top_m, height_m) = (self.ceiling_amsl_m + ABOVE_CEILING_M, alt_amsl_m);
        if height_m > top_m {
            return Some(format!(
                "it is at {height_m:.0} m AMSL: expected at most {top_m:.0} m"
            ));
        }
        let low_m = self.floor_amsl_m? - BELOW_FLOOR_M;
        (!near_home && height_m < low_m)
            .then(|| format!("it is at {height_m:.0} m AMSL: expected at least {low_m:.0} m"))
    }

    /// Whether who is there is outside, or less than `inside_m` inside. Near home the polygon does not count: a vehicle
    /// may have to take off and land beyond it.
    pub fn is_outside(&self, at: Enu, alt_amsl_m: f64, inside_m: f64) -> bool {
        let too_high = alt_amsl_m > self.ceiling_amsl_m + ABOVE_CEILING_M - inside_m;
        // Each vehicle asks in each tick, mostly without a margin: the distance from the edges is then not needed.
        let outside = if inside_m == 0.0 {
            !area::is_inside(&self.fence, at)
        } else {
            area::clearance_m(&self.fence, at) < inside_m
        };
        let beyond = outside && at.distance_m(self.home) > HOME_M - inside_m;
        too_high || beyond
    }
}
