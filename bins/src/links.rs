//! The links of this process to real vehicles: each opened once, whoever shares it.

use crate::Failure;
use mav_bridge::goes_over_all_links;
use mav_bridge::link::{Link, LinkAddress};
use mission::real_vehicle::RealVehicle;
use protocol::message::Severity;
use std::collections::VecDeque;

/// Links, and who is on which.
#[derive(Debug, Default)]
pub struct Links {
    open: Vec<OpenLink>,
    users: Vec<User>,
}

#[derive(Debug)]
struct OpenLink {
    address: String,
    link: Link,
}

/// One vehicle on its links.
#[derive(Debug)]
struct User {
    id: String,
    /// Its links in `open`, in its own order.
    links: Vec<usize>,
    /// What has come for it and was not handed to it yet.
    waiting: VecDeque<(usize, Vec<u8>)>,
}

/// The addresses of a vehicle's links, as the scenario writes them.
///
/// # Errors
/// One that is none.
pub fn addresses(texts: &[String]) -> Result<Vec<LinkAddress>, Failure> {
    let parse = |text: &String| text.parse().map_err(Failure::input);
    texts.iter().map(parse).collect()
}

impl Links {
    /// Puts the vehicle `id` on the links at `addresses`, and opens those that are not open; gives the number by
    /// which it is served.
    ///
    /// # Errors
    /// A port that is taken.
    pub async fn add(&mut self, id: &str, addresses: &[LinkAddress]) -> Result<usize, Failure> {
        let mut links = Vec::new();
        for address in addresses {
            let name = address.to_string();
            let known = self.open.iter().position(|open| open.address == name);
            links.push(match known {
                Some(known) => known,
                None => {
                    let link = Link::open(address).await.map_err(Failure::input)?;
                    let address = name;
                    self.open.push(OpenLink { address, link });
                    self.open.len() - 1
                }
            });
        }
        self.users.push(User {
            id: id.to_owned(),
            links,
            waiting: VecDeque::new(),
        });
        Ok(self.users.len() - 1)
    }

    /// Takes the vehicle `id` off its links.
    pub fn forget(&mut self, id: &str) {
        for user in self.users.iter_mut().filter(|user| user.id == id) {
            user.links.clear();
            user.waiting.clear();
        }
    }

    /// Moves bytes between the links of the vehicle with the number `user` and its bridge, and says on the
    /// console what a person at the vehicle should know.
    pub fn serve(&mut self, user: usize, vehicle: &mut RealVehicle) {
        let Some(buffers) = vehicle.link() else {
            return;
        };
        for link in self.users[user].links.clone() {
            self.take_in(link);
        }
        let user = &mut self.users[user];
        buffers.from_vehicle.extend(user.waiting.drain(..));
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
    }

    /// Takes in what has come over a link, for all who are on it.
    fn take_in(&mut self, link: usize) {
        while let Some(bytes) = self.open[link].link.try_receive() {
            for user in &mut self.users {
                let own = user.links.iter().position(|&l| l == link);
                user.waiting.extend(own.map(|k| (k, bytes.clone())));
            }
        }
    }
}
