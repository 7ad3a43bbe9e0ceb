//! The links of this process to real vehicles: each opened once, also if vehicles share it.

use crate::Failure;
use mav_bridge::goes_over_all_links;
use mav_bridge::link::{Link, LinkAddress};
use mav_bridge::wire::{FrameDecoder, LinkStatistics};
use mission::real_vehicle::LinkBuffers;
use protocol::SimTime;
use protocol::message::Severity;
use std::collections::VecDeque;

/// Links and their vehicles.
#[derive(Debug, Default)]
pub struct Links {
    open: Vec<OpenLink>,
    users: Vec<User>,
}

#[derive(Debug)]
struct OpenLink {
    address: String,
    link: Link,
    /// Finds the frames of several vehicles that share it, so that each gets its own alone.
    decoder: FrameDecoder,
}

/// One vehicle on its links.
#[derive(Debug)]
struct User {
    id: String,
    /// Its MAVLink system, as far as it is known; vehicles that share a link have one each.
    system: Option<u8>,
    /// Its links in `open`, in its own order.
    links: Vec<usize>,
    /// Received bytes that wait for it.
    waiting: VecDeque<(usize, Vec<u8>)>,
    /// Notices about its links that wait for its bridge.
    notices: Vec<String>,
}

/// The addresses of a vehicle's links, as the scenario writes them.
///
/// # Errors
/// An invalid link.
pub fn addresses(texts: &[String]) -> Result<Vec<LinkAddress>, Failure> {
    let parse = |text: &String| text.parse().map_err(Failure::input);
    texts.iter().map(parse).collect()
}

impl Links {
    /// Puts the vehicle `id`, which is the MAVLink system `system` if that was said, on the links at `addresses`,
    /// and opens those that are not open; gives the number by which it is served.
    ///
    /// # Errors
    /// A port that is taken.
    pub async fn add(
        &mut self,
        id: &str,
        system: Option<u8>,
        addresses: &[LinkAddress],
    ) -> Result<usize, Failure> {
        let mut links = Vec::new();
        for address in addresses {
            let name = address.to_string();
            let known = self.open.iter().position(|open| open.address == name);
            links.push(match known {
                Some(known) => known,
                None => {
                    let link = Link::open(address).await.map_err(Failure::input)?;
                    self.open.push(OpenLink {
                        address: name,
                        link,
                        decoder: FrameDecoder::new(),
                    });
                    self.open.len() - 1
                }
            });
        }
        self.users.push(User {
            id: id.to_owned(),
            system,
            links,
            waiting: VecDeque::new(),
            notices: Vec::new(),
        });
        Ok(self.users.len() - 1)
    }

    /// Takes the vehicle with the number `user` off its links.
    pub fn forget(&mut self, user: usize) {
        if let Some(user) = self.users.get_mut(user) {
            user.links.clear();
            user.waiting.clear();
        }
    }

    /// Moves bytes between the links of the vehicle with the number `user` and the `buffers` of its bridge, and says
    /// on the console what a person at the vehicle should know; true if something has come for it.
    pub fn serve(&mut self, user: usize, buffers: &mut LinkBuffers, now: SimTime) -> bool {
        for k in 0..self.users[user].links.len() {
            self.take_in(self.users[user].links[k], now);
        }
        buffers.no_frames = self.lost_before_sharing(user);
        let user = &mut self.users[user];
        buffers.from_vehicle.extend(user.waiting.drain(..));
        buffers.notices.append(&mut user.notices);
        for frame in buffers.to_vehicle.drain(..) {
            let all = goes_over_all_links(&frame);
            for (k, &link) in user.links.iter().enumerate() {
                if all || k == buffers.best_link {
                    // A link that does not keep up loses frames, as any radio does; commands are repeated.
                    let _ = self.open[link].link.send(frame.clone());
                }
            }
        }
        for news in buffers.news.drain(..) {
            let mark = match news.severity {
                Severity::Info => "",
                Severity::Warning => "warning: ",
                Severity::Error => "error: ",
            };
            eprintln!("vehicle {}: {mark}{}", user.id, news.text);
        }
        !buffers.from_vehicle.is_empty()
    }

    /// What has come over links that others share with `user` and was no frame, so that nobody was handed it; the
    /// first on a link tells of it.
    fn lost_before_sharing(&self, user: usize) -> LinkStatistics {
        let mut lost = LinkStatistics::default();
        for &link in &self.users[user].links {
            let first = self.users.iter().position(|u| u.links.contains(&link));
            if first == Some(user) {
                let found = self.open[link].decoder.statistics();
                lost.bytes += found.skipped_bytes;
                lost.skipped_bytes += found.skipped_bytes;
                lost.bad_frames += found.bad_frames;
            }
        }
        lost
    }

    /// Takes in what has come over a link, for all who are on it.
    fn take_in(&mut self, link: usize, now: SimTime) {
        let open = &mut self.open[link];
        let mut on_it: Vec<(&mut User, usize)> = Vec::new();
        for user in &mut self.users {
            let own = user.links.iter().position(|&l| l == link);
            on_it.extend(own.map(|k| (user, k)));
        }
        while let Some(notice) = open.link.try_notice() {
            on_it
                .iter_mut()
                .for_each(|(user, _)| user.notices.push(notice.clone()));
        }
        if let [(user, k)] = &mut on_it[..] {
            let bytes = std::iter::from_fn(|| open.link.try_receive());
            return user.waiting.extend(bytes.map(|bytes| (*k, bytes)));
        }
        // A hundred vehicles that each looked through the frames of all would read every frame a hundred times.
        while let Some(bytes) = open.link.try_receive() {
            open.decoder.push(&bytes);
            while let Some(frame) = open.decoder.next_frame(now) {
                let system = Some(frame.system_id());
                let bytes = frame.into_bytes();
                let owner = on_it.iter_mut().find(|(user, _)| user.system == system);
                if let Some((user, k)) = owner {
                    user.waiting.push_back((*k, bytes));
                    continue;
                }
                // From another system, such as a ground station: for all.
                for (user, k) in &mut on_it {
                    user.waiting.push_back((*k, bytes.clone()));
                }
            }
        }
    }
}
