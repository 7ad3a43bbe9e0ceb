//! Questions between the processes of a mission beside its messages: who is there, where he is reached, what was last
//! said. An answer holds for its question and its key alone and only by the mission's key, so that none can be made up,
//! kept for later or passed off as another's.
//!
//! A thread of its own answers, which does nothing else: agents compute on another, and the threads on which Zenoh reads
//! must not wait until it has written. With TLS one thread does both (`bins/src/tls.rs`): it would wait for itself
//! while the queue to a peer is full, until Zenoh closes the connection, and that peer would count as missing.

use crate::{NetError, random};
use protocol::key::Name;
use protocol::seal::MissionKey;
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::{Duration, Instant};
use zenoh::query::{ConsolidationMode, Query, QueryTarget};

/// Length of a question, bytes: nobody meets one twice.
const QUESTION_BYTES: usize = 16;

/// Asks and answers on the session of one process. What is asked stands in the key, `plumage/<mission>/<path>`.
#[derive(Clone)]
pub(crate) struct Asking {
    session: zenoh::Session,
    prefix: String,
    key: MissionKey,
    answerer: Answerer,
}

/// The thread that answers, until nobody answers by it any more.
#[derive(Clone)]
struct Answerer(mpsc::Sender<Box<dyn FnOnce() + Send>>);

impl Answerer {
    fn start() -> Self {
        let (sender, answers) = mpsc::channel::<Box<dyn FnOnce() + Send>>();
        thread::spawn(move || answers.into_iter().for_each(|answer| answer()));
        Self(sender)
    }

    /// Has it answer a question.
    fn answer(&self, answer: impl FnOnce() + Send + 'static) {
        // It ends after all who could ask.
        let _ = self.0.send(Box::new(answer));
    }
}

/// What somebody answered.
pub(crate) struct Reply {
    /// The path on which he did.
    pub(crate) path: String,
    pub(crate) answer: Vec<u8>,
    /// When he was asked, and how long the answer took to come.
    pub(crate) asked: Instant,
    pub(crate) way: Duration,
}

impl Asking {
    pub(crate) fn new(session: &zenoh::Session, mission: &Name, key: &MissionKey) -> Self {
        Self {
            session: session.clone(),
            prefix: format!("plumage/{mission}/"),
            key: key.clone(),
            answerer: Answerer::start(),
        }
    }

    /// Answers whoever asks on `path` for as long as the session is open. `answer` is given the path on which was
    /// asked, which may stand for several, and answers on one path, or nothing where it has nothing to say.
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub(crate) async fn answer(
        &self,
        path: &str,
        answer: impl Fn(&str) -> Option<(String, Vec<u8>)> + Send + Sync + 'static,
    ) -> Result<(), NetError> {
        let (prefix, key) = (self.prefix.clone(), self.key.clone());
        let expression = format!("{prefix}{path}");
        let reply = move |query: &Query| {
            let asked = query.key_expr().as_str().strip_prefix(&prefix);
            let Some((path, answer)) = asked.and_then(&answer) else {
                return;
            };
            let question = query.payload().map(|p| p.to_bytes().to_vec());
            let question = bound(&question.unwrap_or_default(), &path);
            let code = key.answer_code(&question, &answer);
            // Who asked has gone if the answer does not arrive; it will ask again.
            let reply = query.reply(format!("{prefix}{path}"), answer);
            let _ = zenoh::Wait::wait(reply.attachment(code));
        };
        self.reply(expression, reply).await
    }

    /// Has the thread that answers call `reply` with each question on the key `expression`, for as long as the session is
    /// open.
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub(crate) async fn reply(
        &self,
        expression: String,
        reply: impl Fn(&Query) + Send + Sync + 'static,
    ) -> Result<(), NetError> {
        let (reply, answerer) = (Arc::new(reply), self.answerer.clone());
        self.session
            .declare_queryable(expression)
            .callback(move |query| {
                let reply = Arc::clone(&reply);
                answerer.answer(move || reply(&query));
            })
            .background()
            .await
            .map_err(NetError::zenoh)
    }

    /// Hands `take` what everybody answers `within` this time who answers on `path`, as it comes.
    ///
    /// # Errors
    /// [`NetError::Zenoh`] or [`NetError::Random`].
    pub(crate) async fn ask(
        &self,
        path: &str,
        within: Duration,
        mut take: impl FnMut(Reply),
    ) -> Result<(), NetError> {
        let question: [u8; QUESTION_BYTES] = random()?;
        let asked = Instant::now();
        let replies = self
            .session
            .get(format!("{}{path}", self.prefix))
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .payload(question.to_vec())
            .timeout(within)
            .await
            .map_err(NetError::zenoh)?;
        while let Ok(reply) = replies.recv_async().await {
            let way = asked.elapsed();
            let Ok(sample) = reply.result() else { continue };
            let Some(path) = sample.key_expr().as_str().strip_prefix(&self.prefix) else {
                continue;
            };
            let answer = sample.payload().to_bytes().to_vec();
            let code = sample.attachment().map(|a| a.to_bytes().to_vec());
            let question = bound(&question, path);
            if self
                .key
                .is_answer(&question, &answer, &code.unwrap_or_default())
            {
                take(Reply {
                    path: path.to_owned(),
                    answer,
                    asked,
                    way,
                });
            }
        }
        Ok(())
    }
}

/// A question with the path on which it is answered.
fn bound(question: &[u8], path: &str) -> Vec<u8> {
    [question, path.as_bytes()].concat()
}
