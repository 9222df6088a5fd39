//! Files whose lengths are wrong on purpose: a typed error, without memory or time beyond the size of the file.

use super::*;
use crate::archive::ArchiveWriter;
use crate::npz::{INITIAL_STATE, METADATA};
use crate::ros::MessageType;
use kinetoscope_scene::npy::ElementType;
use mcap::records::op;
use std::time::{Duration, Instant};

/// A record: its type, its length and its content.
fn record(opcode: u8, content: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(content.len() as u64).to_le_bytes(), content].concat()
}

/// A chunk with this declared size and content, without compression and checksum.
fn chunk(uncompressed: u64, compression: &str, content: &[u8]) -> Vec<u8> {
    let mut head = vec![0; 16];
    head.extend(uncompressed.to_le_bytes());
    head.extend(0_u32.to_le_bytes());
    head.extend((compression.len() as u32).to_le_bytes());
    head.extend(compression.as_bytes());
    head.extend((content.len() as u64).to_le_bytes());
    record(op::CHUNK, &[&head[..], content].concat())
}

/// Root causes: mcap reads an attachment beyond its end and subtracts lengths without a check, and asks for as many
/// bytes as a length says.
#[test]
fn mcap_lengths() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let inner = |length: u64| [&[op::MESSAGE][..], &length.to_le_bytes(), &[0; 22]].concat();
    let zeros = lz4::block::compress(&[0; 64], None, false).unwrap();
    for (what, records, expected) in [
        ("attachment without a checksum", record(op::ATTACHMENT, &[0; 32]), "Attachment length"),
        ("attachment with a long name", record(op::ATTACHMENT, &[0xff; 40]), "Attachment length"),
        (
            "record beyond the file",
            [&[op::HEADER][..], &(1_u64 << 29).to_le_bytes(), &[0; 9]].concat(),
            "exceeds limit",
        ),
        ("record beyond its chunk", chunk(31, "", &inner(1000)), "ended in the middle"),
        ("record of the largest length", chunk(31, "", &inner(u64::MAX)), "ended in the middle"),
        ("content longer than declared", chunk(30, "", &inner(22)), "Chunk length"),
        ("content of a gigabyte", chunk(1 << 30, "lz4", &zeros), "exceeds limit"),
        ("no compressed data", chunk(64, "lz4", &[7; 64]), "decompression"),
        ("unknown compression", chunk(31, "brotli", &inner(22)), "brotli"),
    ] {
        let bytes = [mcap::MAGIC, &records, mcap::MAGIC].concat();
        std::fs::write(&path, &bytes).unwrap();
        let error = Recording::open(&path).unwrap_err();
        assert!(matches!(&error, RecordError::Malformed { .. }), "{what}: {error}");
        assert!(error.to_string().contains(expected), "{what}: {error}");
        // The partial file of a killed recording.
        let partial = folder.path().join("run.mcap.part");
        std::fs::rename(&path, &partial).unwrap();
        let error = recover(&path).unwrap_err().to_string();
        assert!(error.contains("it cannot be recovered"), "{what}: {error}");
        std::fs::remove_file(&partial).unwrap();
    }
}

/// Root cause: a name was made for each of the values that the shape of an array promises.
#[test]
fn shapes_of_arrays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let metadata = json!({"streams": [{"name": "s", "columns": [], "env_ids": [0], "arrays": [{"name": "s/x"}]}]});
    let header = |shape: &[usize]| npy::header(ElementType::F64, shape).unwrap();
    let open = |shape: &[usize], values: usize| {
        let mut archive = ArchiveWriter::new(std::fs::File::create(&path).unwrap());
        archive.add(METADATA, metadata.to_string().as_bytes(), &mut std::io::empty()).unwrap();
        archive.add(INITIAL_STATE, b"", &mut std::io::empty()).unwrap();
        archive.add("s/step.npy", &header(&[1]), &mut &[0; 8][..]).unwrap();
        archive.add("s/x.npy", &header(shape), &mut &vec![0; 8 * values][..]).unwrap();
        archive.finish().unwrap();
        Recording::open(&path)
    };
    for shape in [&[1, 1, 1 << 40][..], &[1, 1, usize::MAX, 2], &[1, 1, 2], &[0, 1, 1 << 40]] {
        let error = open(shape, 1).unwrap_err().to_string();
        assert!(error.contains("the number of values of s/x does not match its shape"), "{shape:?}: {error}");
    }
    assert_eq!(open(&[1, 1, 2], 2).unwrap().topics()[0].fields, ["x[0]", "x[1]"], "control");
}

/// Root cause: a nested type without fields takes no byte, so a message of four bytes had any number of values.
#[test]
fn types_without_bytes() {
    let mut text = String::new();
    for level in 0..11 {
        text.extend((0..100).map(|k| format!("a/T{level} f{k}\n")));
        text += &format!("====\nMSG: a/T{level}\n");
    }
    let message_type = MessageType::parse(&text).unwrap();
    let begin = Instant::now();
    assert!(message_type.read(&[0, 1, 0, 0]).is_none());
    // The 100^11 values would take years.
    assert!(begin.elapsed() < Duration::from_secs(1));
}
