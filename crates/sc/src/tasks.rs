//! What each vehicle is doing, and how far the passes have got.

use protocol::SimTime;
use protocol::message::Phase;

use crate::fleet::{Fleet, TeamVehicle};
use crate::passes::Pass;

/// What a vehicle is doing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum VehicleTask {
    /// On the ground, not yet ordered to take off.
    Parked,
    /// Climbing to its layer, since.
    TakingOff(SimTime),
    /// In the air without anything to do.
    Idle,
    /// On the way to the beginning of a pass; there since, waiting for its height.
    Approaching(Pass, Option<SimTime>),
    /// Flying a pass.
    OnPass(Pass),
    /// Following the search.
    Searching,
    /// Flying a pattern, from take-off to landing.
    OnPattern,
    /// On the way to above home, or waiting there for its landing.
    Returning,
    /// Ordered to land, since; and low in the circle beside its approach, since.
    Landing(SimTime, Option<SimTime>),
}

/// The tasks of all vehicles and the progress of the passes.
#[derive(Debug)]
pub(crate) struct Tasks {
    pub each: Vec<VehicleTask>,
    /// Whom the operator has called home.
    pub called: Vec<bool>,
    pub next_pass: usize,
    pub passes_flown: usize,
    /// Consecutive attempts in which no vehicle was free for the next pass.
    pub refused: usize,
}

impl Tasks {
    pub(crate) fn new(vehicles: &[TeamVehicle]) -> Self {
        Self {
            each: vec![VehicleTask::Parked; vehicles.len()],
            called: vec![false; vehicles.len()],
            next_pass: 0,
            passes_flown: 0,
            refused: 0,
        }
    }

    /// Frees those whose work the new phase ends: the search goes on with the passes that are flown before it.
    pub(crate) fn start_phase(&mut self, phase: Phase, fleet: &Fleet) {
        if phase == Phase::Search {
            return;
        }
        self.next_pass = 0;
        self.passes_flown = 0;
        self.refused = 0;
        for (task, vehicle) in self.each.iter_mut().zip(&fleet.vehicles) {
            let in_work = !matches!(
                task,
                VehicleTask::Parked
                    | VehicleTask::TakingOff(_)
                    | VehicleTask::OnPattern
                    | VehicleTask::Returning
                    | VehicleTask::Landing(..)
            );
            let changes = !matches!(phase, Phase::Characterise | Phase::Flux) || vehicle.real;
            if in_work && changes {
                *task = VehicleTask::Idle;
            }
        }
    }
}
