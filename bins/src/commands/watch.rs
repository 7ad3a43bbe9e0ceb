//! `plumage watch`: the page of a mission that runs in processes, simulated or real.

use super::control;
use crate::listener::Listener;
use crate::pace::Reached;
use crate::page::{LivePage, PageArguments, Serve};
use crate::presence::RollCall;
use crate::{Failure, agent, site};
use net::Net;
use net::realtime::MissionClock;
use protocol::{AgentId, Envelope, Interest, SimTime};
use std::sync::Arc;
use std::time::Duration;
use views::live::RunStatus;
use views::page::{DEFAULT_ADDRESS, Offered, PageOptions};

/// How often clicks are looked for.
const CLICKS_EVERY: Duration = Duration::from_millis(50);

/// How long the keeper of the mission's time may take to let the page speak for the operator.
const TOLD_WITHIN: Duration = Duration::from_secs(2);

/// Arguments of `plumage watch`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: plumage watch --scenario scenarios/as-pontes.toml --connect tcp/192.0.2.1:7447"
)]
pub struct WatchArguments {
    #[command(flatten)]
    bus: agent::BusArguments,
    /// Serve the page at this address
    #[arg(long, help_heading = "Page", value_name = "ADDR", default_value = DEFAULT_ADDRESS)]
    serve: String,
    #[command(flatten)]
    page: PageArguments,
}

/// Shows the mission until it is interrupted.
///
/// # Errors
/// Wrong input, an address that is taken, or a bus that cannot be joined.
pub fn watch(arguments: &WatchArguments) -> Result<(), Failure> {
    let setup = arguments.bus.setup()?;
    let site = Arc::new(site::of(&setup)?);
    let team: Vec<String> = setup
        .scenario
        .vehicles
        .iter()
        .map(|v| v.id.clone())
        .collect();
    let duration_s = setup.scenario.mission.duration_s;
    let roll = RollCall::of(&setup)?;
    let options = PageOptions {
        offered: Offered {
            // In lockstep the conductor alone speaks for the operator.
            control: !arguments.bus.lockstep,
            ..Offered::default()
        },
        tiles: arguments.page.tiles()?,
        token: arguments.page.token()?,
        report: None,
    };
    let page = LivePage::open(&Serve::At(arguments.serve.clone()), &setup, site, options)?;
    let Some(mut page) = page else {
        return Ok(());
    };
    eprintln!("live page: http://{}/", page.address);
    let watched = agent::block_on(async {
        let mut net = arguments.bus.open(&setup, false).await?;
        net.subscribe_bundled(&[Interest::Everything]).await?;
        follow(&mut net, &mut page, &team, duration_s, roll).await
    });
    page.close();
    watched
}

async fn follow(
    net: &mut Net,
    page: &mut LivePage,
    team: &[String],
    duration_s: f64,
    mut roll: RollCall,
) -> Result<(), Failure> {
    let mut sequence = 0;
    let mut joined = false;
    let mut reached = Reached::new();
    let mut run = RunStatus {
        speed: 1.0,
        ..RunStatus::default()
    };
    let mut listener = Listener::default();
    let present = net.presence();
    loop {
        tokio::time::sleep(CLICKS_EVERY).await;
        page.take(&listener.heard(net));
        let now = page.with(|live| live.time());
        let last_heard = |id: &str| {
            let ago = present.last_heard(id)?.elapsed();
            Some(SimTime::from_s((now.s() - ago.as_secs_f64()).max(0.0)))
        };
        for change in roll.call(&present.now(), last_heard, now) {
            eprintln!("{}", change.text);
            page.with(|live| live.tell("page", change.severity, change.text));
        }
        run.real_time_factor = reached.factor(now.s());
        run.ended = now.s() >= duration_s;
        page.show(run);
        let wishes = page.commands();
        if !wishes.is_empty() && !joined {
            // Until somebody clicks the page only listens, from before the mission's time is known.
            let asked = tokio::time::timeout(TOLD_WITHIN, MissionClock::ask(net)).await;
            joined = asked.is_ok();
            match asked {
                Ok(asked) => drop(asked?),
                Err(_) => eprintln!(
                    "warning: no process answers requests for the mission's time; the command from the page was not sent"
                ),
            }
        }
        for wish in wishes.into_iter().filter(|_| joined) {
            for (topic, message) in control::told_by_page(wish, team) {
                sequence += 1;
                let envelope = Envelope::new(AgentId::operator(), sequence, now, message);
                net.publish(&topic, &envelope).await?;
            }
        }
    }
}
