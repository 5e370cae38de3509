/* Counts what a rank sends between two points of a program: to be preloaded, see ranks.py. */
#include <mpi.h>

long messages_sent, bytes_sent, collectives;

static void sent(int count, MPI_Datatype type)
{
  int size;
  PMPI_Type_size(type, &size);
  messages_sent += 1;
  bytes_sent += (long) count * size;
}

int MPI_Send(const void *data, int count, MPI_Datatype type, int to, int tag, MPI_Comm comm)
{
  sent(count, type);
  return PMPI_Send(data, count, type, to, tag, comm);
}

int MPI_Isend(const void *data, int count, MPI_Datatype type, int to, int tag, MPI_Comm comm, MPI_Request *request)
{
  sent(count, type);
  return PMPI_Isend(data, count, type, to, tag, comm, request);
}

int MPI_Sendrecv(const void *out, int count, MPI_Datatype type, int to, int tag, void *in, int most,
                 MPI_Datatype in_type, int from, int in_tag, MPI_Comm comm, MPI_Status *status)
{
  sent(count, type);
  return PMPI_Sendrecv(out, count, type, to, tag, in, most, in_type, from, in_tag, comm, status);
}

int MPI_Allreduce(const void *out, void *in, int count, MPI_Datatype type, MPI_Op op, MPI_Comm comm)
{
  collectives += 1;
  return PMPI_Allreduce(out, in, count, type, op, comm);
}
