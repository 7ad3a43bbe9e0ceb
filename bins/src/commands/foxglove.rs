//! `plumage foxglove`: a mission that runs in processes, live in Foxglove.

use crate::listener::{self, Listener};
use crate::{Failure, agent, plume_lines, site};
use protocol::key::Name;
use protocol::message::Model;
use protocol::{Envelope, Interest, Topic};
use record::export::foxglove::{Converter, FoxgloveMessage};
use std::time::Duration;
use views::foxglove::{DEFAULT_ADDRESS, Server};

/// How often what was heard is passed on.
const EVERY: Duration = Duration::from_millis(50);

/// Arguments of `plumage foxglove`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: plumage foxglove --scenario scenarios/as-pontes.toml")]
pub struct FoxgloveArguments {
    #[command(flatten)]
    bus: agent::BusArguments,
    /// Serve Foxglove at this address; open ws://ADDR there
    #[arg(long, value_name = "ADDR", default_value = DEFAULT_ADDRESS, help_heading = "Integrations")]
    serve: String,
}

/// Serves the mission until it is interrupted.
///
/// # Errors
/// Wrong input, an address that is taken, or a bus that cannot be joined.
pub fn foxglove(arguments: &FoxgloveArguments) -> Result<(), Failure> {
    let setup = arguments.bus.setup()?;
    let site = site::of(&setup)?;
    let around = site::surroundings(&setup)?;
    let frame = setup.frame()?;
    agent::block_on(async {
        let mut server = Server::open(&arguments.serve, &setup.scenario.mission.name)
            .await
            .map_err(Failure::input)?;
        let mut net = arguments.bus.open(&setup, false).await?;
        net.subscribe_bundled(&[Interest::Everything]).await?;
        eprintln!("in Foxglove, open a connection to ws://{}", arguments.serve);
        let mission = Name::new(&setup.scenario.mission.name).map_err(Failure::input)?;
        let mut converter: Option<(i64, Converter<'_>)> = None;
        let mut listener = Listener::default();
        loop {
            tokio::time::sleep(EVERY).await;
            for (topic, envelope) in listener.heard(&mut net) {
                let (start, converter) = converter.get_or_insert_with(|| {
                    let plume = |model: &Model| plume_lines::of(&site, model);
                    let start = setup.scenario.mission.start_unix_ns();
                    let start = start.unwrap_or_else(|| listener::begun(&envelope));
                    let converter = Converter::new(Some(start), frame, around.clone(), plume);
                    converter
                        .begin()
                        .into_iter()
                        .for_each(|said| tell(&mut server, start, said));
                    (start, converter)
                });
                let start = *start;
                for said in converter.take(&topic, &envelope) {
                    tell(&mut server, start, said);
                }
                if !matches!(topic, Topic::MavlinkRx(_) | Topic::MavlinkTx(_)) {
                    let schema = || {
                        let schema = Envelope::json_schema(&topic);
                        let name = schema["title"].as_str().unwrap_or("plumage").to_owned();
                        (name, schema.to_string())
                    };
                    let at = unix_ns(start, envelope.time.ns());
                    server.say(&topic.key(&mission), schema, at, envelope.to_json());
                }
            }
        }
    })
}

fn unix_ns(start: i64, since_ns: i64) -> u64 {
    u64::try_from(start.saturating_add(since_ns)).unwrap_or(0)
}

fn tell(server: &mut Server, start: i64, message: FoxgloveMessage) {
    let schema = || {
        (
            message.kind.name().to_owned(),
            message.kind.json_schema().to_string(),
        )
    };
    let at = unix_ns(start, message.time.ns());
    server.say(&message.topic, schema, at, message.json.to_string());
}
