#include "meshreel/status.h"

const char* mr_message(int status) {
    switch (status) {
        case MR_OK: return "no error";
        case MR_BAD_INPUT: return "an index is out of range, indices do not ascend, or a number is not finite";
        case MR_NOT_CAUSAL: return "neighbours must be smaller indices in order";
        case MR_SINGULAR: return "a connected component has no anchor, or elimination fills in as on no surface";
        case MR_NO_MEMORY: return "not enough memory";
        case MR_OVERFLOW: return "a symbol beyond 32 bits";
        case MR_OUT_TOO_SMALL: return "the output has too little room";
        case MR_BAD_STREAM: return "a stream of symbols is truncated or damaged";
        case MR_BAD_RECORD: return "a record is truncated or damaged";
        case MR_BAD_COLUMNS:
            return "a field has more columns than its rows have numbers, or a step that does not exist";
        case MR_BAD_BASIS: return "the integers of a basis are truncated or damaged";
        case MR_BAD_SHARED: return "motion that all vertices share has more bits than it may have";
        case MR_NO_DIRECTION: return "a basis vector without a direction";
        case MR_BAD_SYMBOLS: return "the symbols of a field are truncated or damaged";
        case MR_NO_PREVIOUS: return "a level that is counted from a group which is not at hand, or not to this level";
        case MR_NOT_FINITE: return "vertices that are not finite";
        case MR_NOT_DRACO: return "no Draco data of version 2.2";
        case MR_DRACO_CLOUD: return "a point cloud where a mesh belongs";
        case MR_DRACO_SEQUENTIAL: return "a mesh in sequential coding, not in edgebreaker's";
        case MR_DRACO_METADATA: return "metadata, which no mesh of a stream has";
        case MR_DRACO_TRAVERSAL: return "a traversal of faces that is neither standard nor by valence";
        case MR_DRACO_CLAIMS: return "more faces or points than so few bytes may claim";
        case MR_DRACO_FACES: return "faces or points that are not those it claims";
        case MR_DRACO_STEPS: return "vertices of many faces that are joined again and again";
        case MR_DRACO_ATTRIBUTES: return "attributes other than one of positions: three quantised 32-bit floats";
        case MR_DRACO_PREDICTION: return "positions that are not predicted by wrapped parallelograms";
        case MR_DRACO_LATTICE: return "a lattice that is not finite, or of more than 30 bits";
        case MR_BAD_DRACO: return "positions that do not fill its bytes";
        default: return "an unknown status";
    }
}
