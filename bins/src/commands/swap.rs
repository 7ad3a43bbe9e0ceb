//! `plumage swap`: another aircraft in a vehicle's place, while a mission runs in processes.

use super::control::{self, OperatorCommand};
use crate::{Failure, agent};
use mav_bridge::link::LinkAddress;
use protocol::key::Name;
use protocol::message::{Control, ControlWish, EventMessage, Swap};
use protocol::{AgentId, Message, Topic};

/// Arguments of `plumage swap`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: plumage swap 3 --real udpin:0.0.0.0:14550 --scenario scenarios/as-pontes.toml"
)]
pub struct SwapArguments {
    /// Id of the vehicle to replace
    pub vehicle: String,
    #[command(flatten)]
    aircraft: Aircraft,
    /// Arm the motor of the real aircraft at take-off [default: wait until a person arms it]
    #[arg(long, requires = "real")]
    may_arm: bool,
    /// End the heartbeat to the real aircraft now; its failsafe then acts unless another ground station sends one
    #[arg(long, requires = "simulated")]
    release: bool,
    #[command(flatten)]
    bus: agent::BusArguments,
}

/// What takes its place.
#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct Aircraft {
    /// Fly the vehicle with the real aircraft on this link, such as udpin:0.0.0.0:14550; without a frame within 30 s,
    /// the simulated aircraft continues
    #[arg(long, value_name = "LINK")]
    real: Option<LinkAddress>,
    /// Fly the vehicle with a simulated aircraft, from its current position; the bridge continues its heartbeat to the
    /// real one until it receives another ground station that the failsafe monitors
    #[arg(long)]
    simulated: bool,
}

/// Says it on the bus, and what is answered.
///
/// # Errors
/// A vehicle that the scenario does not have, that is not present, or that refuses.
pub fn swap(arguments: &SwapArguments) -> Result<(), Failure> {
    let setup = arguments.bus.setup()?;
    let id = &arguments.vehicle;
    setup.index_of(id).map_err(Failure::input)?;
    if arguments.aircraft.simulated {
        eprintln!("warning: {}", warning(arguments.release));
    }
    let name = Name::new(id).map_err(Failure::input)?;
    let tell = |topic, message| {
        let to = AgentId::va(id).map_err(Failure::input)?;
        let command = OperatorCommand { to, topic, message };
        control::tell(&arguments.bus, &setup, vec![command], Some(answer))
    };
    let swap = Swap {
        link: arguments.aircraft.real.as_ref().map(ToString::to_string),
        may_arm: arguments.may_arm,
    };
    tell(Topic::Swap(name.clone()), Message::Swap(swap))?;
    if arguments.release {
        let control = Control {
            wish: ControlWish::Release,
            sticks: None,
        };
        tell(Topic::Control(name), Message::Control(control))?;
    }
    Ok(())
}

/// What an operator should know before a real aircraft is let go.
fn warning(release: bool) -> &'static str {
    if release {
        "the bridge ends its heartbeat to the real aircraft; unless the pilot's own ground station is connected, the \
         failsafe for a lost ground station acts some seconds later"
    } else {
        "only its pilot flies the real aircraft now; the bridge continues its heartbeat until it receives the pilot's \
         own ground station, or until --release"
    }
}

/// Whether an event answers a swap, and whether it was made.
fn answer(event: &EventMessage) -> Option<bool> {
    match event.code.as_str() {
        "swapped" | "released" => Some(true),
        "swap-refused" | "release-refused" => Some(false),
        _ => None,
    }
}
