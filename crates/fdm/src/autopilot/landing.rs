//! Landing: down to the approach height in a circle, along the glide path, flare.

use super::energy::EnergyDemand;
use super::guidance::Steering;
use super::plant::Plant;
use crate::scalar::angle;

/// Height at which the flare begins, m.
const FLARE_HEIGHT_M: f64 = 3.0;
/// Approach speed over the slowest flying speed.
const APPROACH_SPEED_FACTOR: f64 = 1.2;
/// How near the approach height must be before final, m.
const HEIGHT_BAND_M: f64 = 8.0;
/// Height at which an approach off its line is given up, m, and how far off it may be there, m.
const DECISION: (f64, f64) = (15.0, 15.0);
/// Descent in the flare per height, 1/s, and at touch-down, m/s.
const FLARE: (f64, f64) = (0.4, 0.4);

/// Largest bank in the flare, rad.
const FLARE_BANK_RAD: f64 = 0.1;
/// Lowest and highest pitch in the flare, rad.
const FLARE_PITCH_RAD: (f64, f64) = (-0.05, 0.18);

/// Where to land.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LandingSite {
    pub north_m: f64,
    pub east_m: f64,
    pub ground_amsl_m: f64,
    pub course_deg: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// To the circle beside the final approach and down in it.
    Descend,
    /// Along the final approach.
    Final,
    /// Over the ground.
    Flare,
}

/// A landing under way.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Landing {
    stage: Stage,
    course_rad: f64,
}

/// What the loops shall do.
pub(super) enum LandingCommand {
    Approach { bank: f64, energy: EnergyDemand },
    Flare { bank: f64, pitch: f64 },
}

impl Landing {
    /// Begins a landing; the approach is into the wind unless ordered otherwise.
    pub fn begin(order: &LandingSite, wind: [f64; 2]) -> Self {
        let into_wind = angle(-wind[1], -wind[0]);
        Self {
            stage: Stage::Descend,
            course_rad: order.course_deg.map_or(into_wind, f64::to_radians),
        }
    }

    pub fn step(
        &mut self,
        steering: &Steering<'_>,
        order: &LandingSite,
        airspeed_m_s: f64,
        plant: &Plant,
    ) -> LandingCommand {
        let sensed = steering.sensed;
        let gains = steering.gains;
        let height = sensed.alt_amsl_m - order.ground_amsl_m;
        let slope = gains.approach_slope_deg.to_radians().tan();
        let (sin, cos) = self.course_rad.sin_cos();
        let (n, e) = (sensed.north_m - order.north_m, sensed.east_m - order.east_m);
        let (along, across) = (n * cos + e * sin, e * cos - n * sin);
        let radius = gains.loiter_radius_m;
        // The circle touches the approach line one turn before the glide path begins.
        let entry = gains.approach_height_m / slope + 2.0 * radius;
        self.advance(height, along, across, entry, steering);
        // A margin over the slowest speed, since wind gradient and gusts take airspeed away near
        // the ground.
        let slow = APPROACH_SPEED_FACTOR * plant.slowest_m_s;
        match self.stage {
            Stage::Descend => LandingCommand::Approach {
                bank: steering.orbit(
                    order.north_m - entry * cos + radius * sin,
                    order.east_m - entry * sin - radius * cos,
                    radius,
                    false,
                ),
                energy: EnergyDemand {
                    alt_amsl_m: order.ground_amsl_m + gains.approach_height_m,
                    airspeed_m_s,
                    climb_m_s: 0.0,
                },
            },
            Stage::Final => {
                // The glide path is level at the approach height until it meets the slope.
                let glide = -along * slope;
                let level = glide >= gains.approach_height_m;
                let [vn, ve, _] = sensed.vel_ned_m_s;
                LandingCommand::Approach {
                    bank: steering.line(order.north_m, order.east_m, self.course_rad),
                    energy: EnergyDemand {
                        alt_amsl_m: order.ground_amsl_m + glide.min(gains.approach_height_m),
                        airspeed_m_s: slow,
                        // Feedforward of the descent, else the altitude loop would lag below or
                        // above a moving target.
                        climb_m_s: if level {
                            0.0
                        } else {
                            -slope * (vn * cos + ve * sin)
                        },
                    },
                }
            }
            Stage::Flare => self.flare(steering, order, plant, height),
        }
    }

    /// Wings nearly level, descent fading with height.
    fn flare(
        &self,
        steering: &Steering<'_>,
        order: &LandingSite,
        plant: &Plant,
        height: f64,
    ) -> LandingCommand {
        let sensed = steering.sensed;
        let speed = sensed.airspeed_m_s.max(5.0);
        // An exponential flare: sink proportional to height gives a smooth touch-down whatever the
        // descent it began with.
        let sink = FLARE.0 * height.max(0.0) + FLARE.1;
        let too_fast = sensed.vel_ned_m_s[2] - sink;
        let level = plant.at(sensed).alpha_level;
        LandingCommand::Flare {
            bank: steering
                .line(order.north_m, order.east_m, self.course_rad)
                .clamp(-FLARE_BANK_RAD, FLARE_BANK_RAD),
            pitch: (level - sink / speed + too_fast / speed)
                .clamp(FLARE_PITCH_RAD.0, FLARE_PITCH_RAD.1),
        }
    }

    fn advance(
        &mut self,
        height: f64,
        along: f64,
        across: f64,
        entry: f64,
        steering: &Steering<'_>,
    ) {
        let gains = steering.gains;
        match self.stage {
            Stage::Descend => {
                // Final begins only when it can be flown: on course, on the line, at height.
                let aligned = (steering.sensed.yaw_rad - self.course_rad).cos() > 0.9;
                let near = across.abs() < 0.5 * gains.loiter_radius_m
                    && (along + entry).abs() < gains.loiter_radius_m;
                if aligned && near && (height - gains.approach_height_m).abs() < HEIGHT_BAND_M {
                    self.stage = Stage::Final;
                }
            }
            Stage::Final => {
                if height < FLARE_HEIGHT_M {
                    self.stage = Stage::Flare;
                // Off the line this low, or past the point: around again rather than a landing
                // beside the field.
                } else if (height < DECISION.0 && across.abs() > DECISION.1) || along > 0.0 {
                    self.stage = Stage::Descend;
                }
            }
            Stage::Flare => {}
        }
    }
}
