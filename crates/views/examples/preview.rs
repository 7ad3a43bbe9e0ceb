//! The page and the report of a made-up mission, to look at while changing them:
//! `cargo run -p views --example preview`, then open <http://127.0.0.1:8787>. The reports are
//! written to the folder given as argument, or the temporary folder.
#![allow(clippy::unwrap_used)]

#[path = "../tests/made_up/mod.rs"]
mod made_up;

use made_up::synthetic;
use std::path::PathBuf;
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use views::live::LiveState;
use views::page::{self, Live, Offered, PageCommand, PageOptions};

#[tokio::main(flavor = "current_thread")]
async fn main() {
    let folder = std::env::args()
        .nth(1)
        .map_or_else(std::env::temp_dir, PathBuf::from);
    let report = folder.join("report.html");
    record::files::write_whole(&report, made_up::report(6000).0.as_bytes()).unwrap();
    let gap = folder.join("gap.html");
    let page = views::gap_report::plume("made up", &made_up::gap::json(), &made_up::gap::report());
    let page = page.html(&views::Origin::default());
    record::files::write_whole(&gap, page.as_bytes()).unwrap();
    println!("reports: {} and {}", report.display(), gap.display());

    let live = Live::new(LiveState::new(made_up::site()));
    let (open, is_open) = watch::channel(());
    let (commands, mut asked) = mpsc::channel(16);
    let listener = page::listen(page::DEFAULT_ADDRESS).await.unwrap();
    println!("page: http://{}", page::DEFAULT_ADDRESS);
    let options = PageOptions {
        offered: Offered {
            pause: true,
            speed: true,
            control: true,
            timeline_s: None,
        },
        ..PageOptions::default()
    };
    let server = tokio::spawn(page::serve(
        listener,
        live.clone(),
        options,
        commands,
        is_open,
    ));
    live.with(|live| live.run.real_time_factor = 20.0);
    for n in 0..6000 {
        live.with(|live| {
            for (topic, envelope) in synthetic::tick(n) {
                live.take(&topic, &envelope);
            }
            if n % 700 == 0 {
                let (topic, envelope) = synthetic::event(n, "a made-up event to look at");
                live.take(&topic, &envelope);
            }
        });
        while let Ok(command) = asked.try_recv() {
            live.with(|live| live.run.paused = command == PageCommand::Pause);
            println!("{command:?}");
        }
        if n % 20 == 0 {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }
    live.with(|live| live.run.ended = true);
    // The page stays until the program is stopped.
    server.await.unwrap();
    drop(open);
}
