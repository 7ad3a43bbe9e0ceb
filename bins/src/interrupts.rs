//! What ends a program from outside: an interrupt from the keyboard, or the system's request to terminate, as systemd
//! and docker send it. Both mean the same: end in good order, with all outputs.

/// The word for the system's request.
pub const TERMINATED: &str = "asked to terminate";

/// Waits for requests to end.
pub struct Interrupts {
    #[cfg(unix)]
    terminate: Option<tokio::signal::unix::Signal>,
}

impl Interrupts {
    /// From now on such a request does not end the program by itself. To be called within a runtime.
    pub fn watch() -> Self {
        Self {
            #[cfg(unix)]
            terminate: tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())
                .ok(),
        }
    }

    /// Waits for the next request, and says in a word or two what it was.
    pub async fn next(&mut self) -> &'static str {
        #[cfg(unix)]
        if let Some(terminate) = &mut self.terminate {
            return tokio::select! {
                _ = terminate.recv() => TERMINATED,
                _ = tokio::signal::ctrl_c() => "interrupted",
            };
        }
        // Without a handler nobody waits in vain: the program ends as it would have without one.
        let _ = tokio::signal::ctrl_c().await;
        "interrupted"
    }
}
