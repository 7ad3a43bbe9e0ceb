//! `plumage control`: who shall fly a vehicle of a mission that runs in processes, and whether it
//! comes home.

use crate::{Failure, agent};
use clap::ValueEnum;
use mission::Setup;
use net::Net;
use net::realtime::MissionClock;
use protocol::key::Name;
use protocol::message::EventMessage;
use protocol::message::{Control, ControlWish};
use protocol::text::printable;
use protocol::{AgentId, Envelope, Interest, Message, Topic};
use std::collections::BTreeMap;
use std::time::Duration;
use views::page::PageCommand;

/// How long the vehicles may take to appear, s.
const PATIENCE_S: u64 = 10;
/// How long a vehicle may take to answer a hand-back, s: a real one shows GUIDED a heartbeat or two later.
const ANSWER_S: u64 = 8;
/// Time for messages to leave before the connection is closed, ms.
const LEAVE_MS: u64 = 300;

/// What to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Wish {
    /// Return vehicles to automatic flight
    HandBack,
    /// Take over simulated vehicles: they fly level until handed back
    TakeOver,
    /// Call vehicles home: they land in turn, and those on the ground stay there
    Home,
}

/// Arguments of `plumage control`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: plumage control home --vehicles 3,4 --scenario scenarios/as-pontes.toml"
)]
pub struct ControlArguments {
    /// Command for the vehicles
    pub wish: Wish,
    /// Ids of the vehicles, separated by commas [default: all of the team]
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    pub vehicles: Vec<String>,
    #[command(flatten)]
    bus: agent::BusArguments,
}

/// Says it on the bus.
///
/// # Errors
/// Vehicles that the scenario does not have, that are not present, or that refuse a hand-back.
pub fn control(arguments: &ControlArguments) -> Result<(), Failure> {
    let setup = arguments.bus.setup()?;
    let ids: Vec<String> = if arguments.vehicles.is_empty() {
        let all = setup.scenario.vehicles.iter();
        all.map(|v| v.id.clone()).collect()
    } else {
        for id in &arguments.vehicles {
            setup.index_of(id).map_err(Failure::input)?;
        }
        arguments.vehicles.clone()
    };
    let control = Control {
        wish: match arguments.wish {
            Wish::HandBack => ControlWish::HandBack,
            Wish::TakeOver => ControlWish::TakeOver,
            Wish::Home => ControlWish::Home,
        },
        sticks: None,
    };
    let command = |id: &String| {
        Ok(OperatorCommand {
            to: AgentId::va(id).map_err(Failure::input)?,
            topic: Topic::Control(Name::new(id).map_err(Failure::input)?),
            message: Message::Control(control),
        })
    };
    let commands: Result<Vec<OperatorCommand>, Failure> = ids.iter().map(command).collect();
    let answered = arguments.wish == Wish::HandBack;
    tell(
        &arguments.bus,
        &setup,
        commands?,
        answered.then_some(hand_back_taken),
    )?;
    if !answered {
        let wish = arguments.wish.to_possible_value();
        let wish = wish.map_or(String::new(), |v| v.get_name().to_owned());
        println!("Commanded {}: {wish}", ids.join(", "));
    }
    Ok(())
}

/// The operator's messages for a command from the page to a vehicle, or to all of `team`.
pub(super) fn told_by_page(wish: PageCommand, team: &[String]) -> Vec<(Topic, Message)> {
    let to = |id: &str, wish| {
        let topic = Topic::Control(Name::new(id).ok()?);
        Some((topic, Message::Control(Control { wish, sticks: None })))
    };
    match wish {
        PageCommand::HandBack(id) => to(&id, ControlWish::HandBack).into_iter().collect(),
        PageCommand::Home(Some(id)) => to(&id, ControlWish::Home).into_iter().collect(),
        PageCommand::Home(None) => {
            let all = team.iter().filter_map(|id| to(id, ControlWish::Home));
            all.collect()
        }
        PageCommand::TakeOver(id, place) | PageCommand::SendTo(id, place) => {
            let taken = to(&id, ControlWish::TakeOver);
            let sent = Name::new(&id).map(|name| {
                let message = Message::Destination(place);
                (Topic::Destination(name), message)
            });
            taken.into_iter().chain(sent.ok()).collect()
        }
        PageCommand::Pause | PageCommand::Resume | PageCommand::Speed(_) | PageCommand::Seek(_) => {
            Vec::new()
        }
    }
}

/// A command of the operator to a vehicle.
pub(super) struct OperatorCommand {
    /// The vehicle.
    pub to: AgentId,
    /// The topic on which it is published.
    pub topic: Topic,
    /// The command.
    pub message: Message,
}

/// Whether an event answers what was told, and whether that was taken.
pub(super) type Answer = fn(&EventMessage) -> Option<bool>;

/// Tells vehicles of a mission something in the operator's name; with `answer` their answers are waited for and
/// printed.
///
/// # Errors
/// Vehicles that are not present, a mission without time, and what is refused or not answered.
pub(super) fn tell(
    bus: &agent::BusArguments,
    setup: &Setup,
    commands: Vec<OperatorCommand>,
    answer: Option<Answer>,
) -> Result<(), Failure> {
    let names: Vec<AgentId> = commands.iter().map(|command| command.to.clone()).collect();
    agent::block_on(async {
        let mut net = bus.open(setup, false).await?;
        let patience = Duration::from_secs(PATIENCE_S);
        let found = tokio::time::timeout(patience, net.wait_for(&names)).await;
        if found.is_err() {
            let names: Vec<String> = names.iter().map(ToString::to_string).collect();
            return Err(Failure::Run(anyhow::anyhow!(
                "not all of {} joined the bus within {PATIENCE_S} s",
                names.join(", ")
            )));
        }
        let asked = tokio::time::timeout(patience, MissionClock::ask(&net)).await;
        let clock = asked.map_err(|_| {
            anyhow::anyhow!(
                "sc does not answer requests for the mission's time; commands need a mission in real time, \
                 not in lockstep"
            )
        })??;
        let answers: Vec<Interest> = names
            .iter()
            .map(|name| Interest::One(Topic::Event(name.clone())))
            .collect();
        net.subscribe(&answers).await?;
        for (k, command) in commands.into_iter().enumerate() {
            let envelope = Envelope::new(
                AgentId::operator(),
                k as u64 + 1,
                clock.now(),
                command.message,
            );
            net.publish(&command.topic, &envelope).await?;
        }
        let answered = match answer {
            Some(answer) => print_answers(&mut net, &names, answer).await,
            None => {
                tokio::time::sleep(Duration::from_millis(LEAVE_MS)).await;
                Ok(())
            }
        };
        net.close().await;
        answered
    })
}

/// Prints what each vehicle answers.
///
/// # Errors
/// One that refuses, or does not answer.
async fn print_answers(net: &mut Net, names: &[AgentId], answer: Answer) -> Result<(), Failure> {
    let deadline = tokio::time::Instant::now() + Duration::from_secs(ANSWER_S);
    let mut answers: BTreeMap<AgentId, (bool, String)> = BTreeMap::new();
    while answers.len() < names.len() {
        let Ok(Some(received)) = tokio::time::timeout_at(deadline, net.receive()).await else {
            break;
        };
        let Ok((_, envelope)) = received else {
            continue;
        };
        let Message::Event(event) = &envelope.message else {
            continue;
        };
        if let Some(taken) = answer(event) {
            let last = (taken, printable(&event.text).into_owned());
            answers.entry(envelope.sender.clone()).or_insert(last);
        }
    }
    let mut refused = Vec::new();
    for name in names {
        match answers.get(name) {
            Some((true, text)) => println!("{name}: {text}"),
            Some((false, text)) => refused.push(format!("{name}: {text}")),
            None => refused.push(format!("{name} did not answer within {ANSWER_S} s")),
        }
    }
    if refused.is_empty() {
        return Ok(());
    }
    Err(Failure::Run(anyhow::anyhow!(refused.join("; "))))
}

/// Whether an event answers a hand-back, and whether it was taken.
fn hand_back_taken(event: &EventMessage) -> Option<bool> {
    match event.code.as_str() {
        "hand-back" | "guided" => Some(true),
        "hand-back-refused" | "hand-back-failed" => Some(false),
        _ => None,
    }
}
