//! The live page beside a run: a runtime of its own, so that the run itself waits for nobody.

use crate::Failure;
use protocol::bus::Publication;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, watch};
use views::live::LiveState;
use views::page::{self, DEFAULT_ADDRESS, PageCommand};
use views::site::SiteMap;

/// Time between two frames that the run hands over.
const FRAME: Duration = Duration::from_millis(150);

/// Where a page is asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Serve {
    /// At the default address, if that is free.
    Default,
    /// At this address or not at all.
    At(String),
    /// No page.
    No,
}

/// The page of a run.
pub struct LivePage {
    runtime: tokio::runtime::Runtime,
    state: LiveState,
    frames: watch::Sender<Arc<LiveState>>,
    commands: mpsc::Receiver<PageCommand>,
    server: tokio::task::JoinHandle<()>,
    next: Instant,
    /// Where it is.
    pub address: String,
}

impl LivePage {
    /// Opens the page that `serve` asks for; none if none was asked for or the default address
    /// is taken, which is a warning.
    ///
    /// # Errors
    /// An address that was asked for and is not to be had.
    pub fn open(serve: &Serve, site: Arc<SiteMap>) -> Result<Option<Self>, Failure> {
        let address = match serve {
            Serve::No => return Ok(None),
            Serve::Default => DEFAULT_ADDRESS,
            Serve::At(address) => address,
        };
        let runtime = tokio::runtime::Builder::new_multi_thread()
            // One thread is enough to send some frames a second, and leaves the others to the run.
            .worker_threads(1)
            .thread_name("page")
            .enable_all()
            .build()?;
        let listener = match runtime.block_on(page::listen(address)) {
            Ok(listener) => listener,
            Err(e) if *serve == Serve::Default => {
                eprintln!("warning: no live page: {e}");
                return Ok(None);
            }
            Err(e) => return Err(Failure::input(e)),
        };
        let address = listener.local_addr()?.to_string();
        let state = LiveState::new(site);
        let (frames, live) = watch::channel(Arc::new(state.clone()));
        let (commands_sender, commands) = mpsc::channel(16);
        let server = runtime.spawn(async move {
            if let Err(e) = page::serve(listener, live, commands_sender).await {
                eprintln!("warning: the live page has ended: {e}");
            }
        });
        Ok(Some(Self {
            runtime,
            state,
            frames,
            commands,
            server,
            next: Instant::now(),
            address,
        }))
    }

    /// Takes in what was said in a tick.
    pub fn take(&mut self, said: &[Publication]) {
        for (topic, envelope) in said {
            self.state.take(topic, envelope);
        }
    }

    /// Shows how the run goes, if it is time for a new frame or `now` it must be.
    pub fn show(&mut self, run: views::live::RunStatus, now: bool) {
        if now || Instant::now() >= self.next {
            self.next = Instant::now() + FRAME;
            self.state.run = run;
            self.frames.send_replace(Arc::new(self.state.clone()));
        }
    }

    /// What people at the page asked for since the last call.
    pub fn commands(&mut self) -> Vec<PageCommand> {
        std::iter::from_fn(|| self.commands.try_recv().ok()).collect()
    }

    /// Keeps the last frame up until `stop`, then closes the page.
    pub fn close(self, hold: bool, stop: &AtomicBool) {
        while hold && !stop.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(50));
        }
        drop(self.frames);
        let grace = tokio::time::Duration::from_secs(2);
        let server = self.server;
        // Whoever still reads the page has this long to get the last frame.
        let _ = self
            .runtime
            .block_on(async move { tokio::time::timeout(grace, server).await });
        self.runtime.shutdown_timeout(Duration::from_millis(200));
    }
}
