//! Whether an address is on this host alone.

use std::net::IpAddr;

/// Of a socket, such as `127.0.0.1:8787`. A name that only begins like an address, such as `127.0.0.1.example.org`,
/// may be anybody's.
pub fn is_address(address: &str) -> bool {
    let Some((host, _)) = address.rsplit_once(':') else {
        return false;
    };
    let bare = host.strip_prefix('[').and_then(|h| h.strip_suffix(']'));
    let number = bare.unwrap_or(host).parse::<IpAddr>();
    host == "localhost" || number.is_ok_and(|ip| ip.is_loopback())
}

/// Of the bus, such as `tcp/127.0.0.1:7447`; what follows as `?metadata` or `#settings` is no part of the address.
pub fn is_endpoint(endpoint: &str) -> bool {
    let address = endpoint.split_once('/').map_or(endpoint, |e| e.1);
    is_address(address.split(['?', '#']).next().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_this_host_is_this_host() {
        for own in [
            "127.0.0.1:8787",
            "127.4.5.6:0",
            "localhost:7447",
            "[::1]:7447",
        ] {
            assert!(is_address(own), "{own}");
            assert!(is_endpoint(&format!("tcp/{own}")), "{own}");
        }
        for afar in [
            "0.0.0.0:8787",
            "192.0.2.1:8787",
            "[::]:8787",
            "127.0.0.1.example.org:8787",
            "localhost.example.org:8787",
            "127.example.org:8787",
            "127.0.0.1",
            "",
        ] {
            assert!(!is_address(afar), "{afar}");
            assert!(!is_endpoint(&format!("tls/{afar}")), "{afar}");
        }
        assert!(is_endpoint("tcp/[::1]:7447#iface=lo"));
        assert!(is_endpoint("tcp/127.0.0.1:7447?rel=1"));
        assert!(!is_endpoint("tcp/192.0.2.1:7447#bind=127.0.0.1:0"));
    }
}
