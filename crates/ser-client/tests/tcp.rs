//! A TCP connection to a recorder: the conversation, and every way in which the connection fails.

mod common;

use std::io::{Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use common::Recorder;
use ser_client::{
    Diagnosis, Endpoint, OpenError, Options, RequestError, TcpTransport, Transport, TransportError,
    Unit, open,
};
use ser_proto::{FrameEncoder, Reply};

fn listener() -> (TcpListener, String) {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = listener.local_addr().unwrap().to_string();
    (listener, address)
}

fn connect(options: Options) -> (Unit, TcpStream) {
    let (listener, address) = listener();
    let transport = open(&Endpoint::Tcp { address }, 9600).unwrap();
    assert_eq!(transport.bits_per_second(), None);
    (Unit::new(transport, options), listener.accept().unwrap().0)
}

#[test]
fn a_request_and_its_answer() {
    let (mut client, mut peer) = connect(Options { timeout: Duration::from_secs(20), retries: 0 });
    let unit = std::thread::spawn(move || {
        let mut request = [0; 13];
        peer.read_exact(&mut request).unwrap();
        let mut recorder = Recorder::new(5);
        recorder.append_many(7);
        let reply = Reply::Read(recorder.read(1, 1));
        peer.write_all(&FrameEncoder::new(reply.to_body()).collect::<Vec<_>>()).unwrap();
        request
    });
    assert_eq!(client.log_position().unwrap().total, 7);
    assert_eq!(&unit.join().unwrap(), b"\x1B045200010154");
}

#[test]
fn a_peer_that_goes_away_before_it_has_said_anything_serves_somebody_else() {
    let (mut client, peer) = connect(Options { timeout: Duration::from_millis(1), retries: 1 });
    let error = client.mode().unwrap_err();
    assert!(
        matches!(error, RequestError::NoReply { attempts: 2, diagnosis: Diagnosis::Silent, .. }),
        "{error:?}"
    );
    drop(peer);
    let error = client.wait_event(Duration::from_secs(20)).unwrap_err();
    assert!(
        matches!(error, RequestError::Transport(TransportError::TurnedAway { .. })),
        "{error:?}"
    );
    let error = client.mode().unwrap_err();
    assert!(
        matches!(error, RequestError::Transport(TransportError::TurnedAway { .. })),
        "{error:?}"
    );
    assert!(error.to_string().ends_with("before the first answer"), "{error}");
    assert!(error.hint().is_some_and(|hint| hint.contains("another client")), "{:?}", error.hint());
}

#[test]
fn a_peer_that_says_why_it_goes_is_quoted() {
    let (mut client, mut peer) = connect(Options { timeout: Duration::from_secs(20), retries: 0 });
    peer.write_all(b"busy: 10.0.0.9:4711\r\n has the line\r\n").unwrap();
    peer.write_all(&[b'.'; 1000]).unwrap();
    peer.shutdown(std::net::Shutdown::Write).unwrap();
    let error = client.mode().unwrap_err().to_string();
    assert!(error.contains("which said: busy: 10.0.0.9:4711 has the line ..."), "{error}");
    assert!(error.len() < 400, "{error}");
}

#[test]
fn a_peer_that_goes_away_in_the_middle_has_ended() {
    let (mut client, mut peer) = connect(Options { timeout: Duration::from_millis(1), retries: 0 });
    peer.write_all(b"\x1B\r\na line\r\n").unwrap();
    client.wait_event(Duration::from_secs(20)).unwrap();
    drop(peer);
    let error = loop {
        if let Err(error) = client.wait_event(Duration::from_secs(20)) {
            break error;
        }
    };
    assert!(matches!(error, RequestError::Transport(TransportError::Closed)), "{error:?}");
}

#[test]
fn a_question_to_a_peer_that_has_hung_up_says_the_same_whichever_way_it_is_noticed() {
    // Closing with unread bytes resets the connection.
    for read in [false, true] {
        let (mut client, mut peer) =
            connect(Options { timeout: Duration::from_secs(20), retries: 0 });
        let closing = std::thread::spawn(move || {
            peer.peek(&mut [0]).unwrap();
            if read {
                peer.read_exact(&mut [0; 7]).unwrap();
            }
        });
        let error = client.mode().unwrap_err();
        closing.join().unwrap();
        assert!(
            matches!(error, RequestError::Transport(TransportError::TurnedAway { .. })),
            "{error:?}"
        );
    }
}

#[test]
fn nothing_to_read_is_zero_after_the_timeout() {
    let (listener, address) = listener();
    let mut transport = TcpTransport::connect(&address).unwrap();
    let _peer = listener.accept().unwrap();
    let before = Instant::now();
    assert_eq!(transport.read(&mut [0; 8], Duration::from_millis(30)).unwrap(), 0);
    assert!(before.elapsed() >= Duration::from_millis(30));
    assert_eq!(transport.read(&mut [0; 8], Duration::ZERO).unwrap(), 0);
    assert_eq!(transport.read(&mut [0; 8], Duration::from_nanos(1)).unwrap(), 0);
    transport.set_baud(300).unwrap();
}

#[test]
fn nobody_listens() {
    let (listener, address) = listener();
    drop(listener);
    let error = TcpTransport::connect(&address).unwrap_err();
    assert!(
        matches!(&error, OpenError::Refused { address: refused } if *refused == address),
        "{error:?}"
    );
}

#[test]
fn a_host_that_does_not_exist() {
    for address in ["no such host:1", "localhost", "localhost:70000"] {
        let error = TcpTransport::connect(address).unwrap_err();
        assert!(matches!(error, OpenError::HostNotFound { .. }), "{error:?}");
    }
}
