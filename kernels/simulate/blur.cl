#include "common.clh"
#include "spread.clh"
