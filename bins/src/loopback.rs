//! Whether an address is on this host alone.

/// Of a socket, such as `127.0.0.1:8787`.
pub fn is_address(address: &str) -> bool {
    ["127.", "localhost:", "[::1]"]
        .iter()
        .any(|start| address.starts_with(start))
}

/// Of the bus, such as `tcp/127.0.0.1:7447`.
pub fn is_endpoint(endpoint: &str) -> bool {
    is_address(endpoint.split_once('/').map_or(endpoint, |e| e.1))
}
