//! Questions between the processes of a mission beside its messages: who is there, where he is reached, what was last
//! said. An answer holds for its question alone and only by the mission's key, so that none can be made up or kept for
//! later.

use crate::{NetError, random};
use protocol::key::Name;
use protocol::seal::MissionKey;
use std::time::{Duration, Instant};
use zenoh::query::{ConsolidationMode, QueryTarget};

/// Length of a question, bytes: nobody meets one twice.
const QUESTION_BYTES: usize = 16;

/// Asks and answers on the session of one process. What is asked stands in the key,
/// `plumage/<mission>/peer/<path>`.
#[derive(Clone)]
pub(crate) struct Asking {
    session: zenoh::Session,
    prefix: String,
    key: MissionKey,
}

impl Asking {
    pub(crate) fn new(session: &zenoh::Session, mission: &Name, key: &MissionKey) -> Self {
        Self {
            session: session.clone(),
            prefix: prefix(mission),
            key: key.clone(),
        }
    }

    /// Answers whoever asks on `path` for as long as the session is open. `answer` is given the path on which was
    /// asked, and answers nothing where it has nothing to say.
    ///
    /// # Errors
    /// [`NetError::Zenoh`].
    pub(crate) async fn answer(
        &self,
        path: &str,
        answer: impl Fn(&str) -> Option<Vec<u8>> + Send + Sync + 'static,
    ) -> Result<(), NetError> {
        let (prefix, key) = (self.prefix.clone(), self.key.clone());
        self.session
            .declare_queryable(format!("{prefix}{path}"))
            .callback(move |query| {
                let asked = query.key_expr().clone();
                let path = asked.as_str().strip_prefix(&prefix);
                let Some(answer) = path.and_then(&answer) else {
                    return;
                };
                let question = query.payload().map(|p| p.to_bytes().to_vec());
                let code = key.answer_code(&question.unwrap_or_default(), &answer);
                // Who asked has gone if the answer does not arrive; it will ask again.
                let _ = zenoh::Wait::wait(query.reply(asked, answer).attachment(code));
            })
            .background()
            .await
            .map_err(NetError::zenoh)
    }

    /// What everybody answers `within` this time who answers on `path`, and how long each answer took to come.
    ///
    /// # Errors
    /// [`NetError::Zenoh`] or [`NetError::Random`].
    pub(crate) async fn ask(
        &self,
        path: &str,
        within: Duration,
    ) -> Result<Vec<(Vec<u8>, Duration)>, NetError> {
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
        let mut answers = Vec::new();
        while let Ok(reply) = replies.recv_async().await {
            let way = asked.elapsed();
            let Ok(sample) = reply.result() else { continue };
            let answer = sample.payload().to_bytes().to_vec();
            let code = sample.attachment().map(|a| a.to_bytes().to_vec());
            if self
                .key
                .is_answer(&question, &answer, &code.unwrap_or_default())
            {
                answers.push((answer, way));
            }
        }
        Ok(answers)
    }
}

/// What the keys of all questions begin with.
pub(crate) fn prefix(mission: &Name) -> String {
    format!("plumage/{mission}/peer/")
}
